// HDF5's single-writer, multiple-reader mode: a reader opens with swmr=True (h5py) or H5F_ACC_SWMR_READ and
// is never blocked. A run that was killed leaves the file marked as being written: SWMR readers still open
// it, others after `h5clear -s series.h5`. A run that ended in order leaves a plain file.
#include <algorithm>
#include <array>
#include <bit>

#include "error.hpp"
#include "output/files.hpp"
#include "output/hdf5.hpp"

namespace moraine::output {
namespace {

constexpr hsize_t chunk = 256;  // rows

using Numbers = std::array<double, sizeof(Row) / sizeof(double)>;

void create(const std::filesystem::path& path, const std::vector<Row>& rows,
            const std::vector<std::size_t>& wanted) {
  const auto file = hdf5::File::create(path);
  file.set("program", std::string("moraine"));
  std::vector<double> numbers(rows.size());
  for (const std::size_t c : wanted) {
    const auto& [name, units, meaning] = columns()[c];
    std::transform(rows.begin(), rows.end(), numbers.begin(),
                   [c](const Row& row) { return std::bit_cast<Numbers>(row)[c]; });
    const auto dataset = file.create_dataset(name, hdf5::element<double>(), rows.size(), chunk);
    file.write_dataset(dataset, hdf5::element<double>(), numbers.data());
    file.label(dataset, name, "units", units);
    file.label(dataset, name, "meaning", meaning);
  }
  file.flush();
}

}  // namespace

const std::vector<Column>& columns() {
  static const std::vector<Column> list = {
      {"stage", "1", "index of the stage, from 0"},
      {"step", "1", "steps since the stage began"},
      {"time", "s", "time since the case began"},
      {"stage_time", "s", "time since the stage began"},
      {"shear_strain", "1", "displacement of the top layer over the height of the bed when the stage began"},
      {"shear_stress", "Pa", "force along x on the top layer over the cross-section"},
      {"normal_stress", "Pa",
       "force of the grains on the top wall (the floor, where there is none) over the cross-section"},
      {"shear_friction", "1", "shear stress over normal stress"},
      {"height", "m",
       "height of the bed: the top wall, the highest point of any grain, or the box where it is pressed"},
      {"dilation", "m", "height gained since the stage began"},
      {"dilation_diameters", "1", "height gained since the stage began, in mean grain diameters"},
      {"porosity", "1", "share of the bed that is not grains"},
      {"mean_overlap", "m", "mean overlap of the contacts between grains"},
      {"max_overlap", "m", "largest overlap of the contacts between grains"},
      {"coordination", "1", "contacts between grains for each grain"},
      {"unbalanced_force", "1", "mean net force on free grains over mean normal contact force"},
      {"kinetic", "J", "kinetic energy of translation"},
      {"rotational", "J", "kinetic energy of rotation"},
      {"elastic_normal", "J", "energy of the normal springs"},
      {"elastic_tangential", "J", "energy of the tangential springs"},
      {"potential", "J", "potential energy in gravity"},
      {"wall_kinetic", "J", "kinetic energy of the top wall, and of layer_mass"},
      {"slip", "J", "dissipated by sliding friction since the stage began"},
      {"viscous", "J", "dissipated by contact viscosity since the stage began"},
      {"top_wall_work", "J",
       "work of the load on the top wall, or of the sides of a pressed box, since the stage began"},
      {"layers_work", "J", "work of the driven layers since the stage began"},
      {"residue", "J", "energy that the balance leaves unexplained since the stage began"},
      {"wall_water_pressure", "Pa", "pressure of the water on the top wall, over hydrostatic"},
      {"total_friction", "1", "shear stress over what grains and water together press on the top wall"},
      {"water_pressure_mean", "Pa",
       "mean pressure over hydrostatic: upper half of a sheared bed, else all of it"},
      {"water_pressure_min", "Pa", "least pressure there"},
      {"water_pressure_max", "Pa", "largest pressure there"},
      {"water_drained_top", "m3", "water that left through the top since the stage began"},
      {"water_drained_bottom", "m3", "water that left through the floor since the stage began"},
      {"water_volume", "m3", "water in the bed, as much as it would be without excess pressure"},
      {"water_balance", "m3", "water that the account leaves unexplained since the stage began"},
      {"water_work", "J", "work of the water on grains and wall since the stage began"},
      {"water_stored", "J", "energy of the compressed water"},
      {"water_dissipated", "J", "dissipated by the flow of the water since the stage began"},
      {"side_x", "m", "side of the box along x"},
      {"side_y", "m", "side of the box along y"},
      {"side_z", "m", "side of the box along z"},
      {"stress_x", "Pa", "stress of the contacts along x, positive in compression"},
      {"stress_y", "Pa", "stress of the contacts along y"},
      {"stress_z", "Pa", "stress of the contacts along z"},
      {"asked_normal_stress", "Pa", "normal stress asked for"},
      {"asked_shear_stress", "Pa", "shear stress asked for"},
      {"asked_velocity", "m/s", "velocity of the top layer asked for"},
      {"asked_top_pressure", "Pa", "pressure of the water asked for at the top"},
      {"asked_bottom_pressure", "Pa", "pressure of the water asked for at the floor"},
  };
  return list;
}

struct Series::Impl {
  hdf5::File file;
  std::vector<std::size_t> wanted;  // columns
  std::vector<hdf5::Handle> datasets;
  std::vector<Row> rows;
  bool failed = false;
};

Series::Series(const std::filesystem::path& path, const std::vector<Row>& rows, bool with_water,
               bool with_sides, bool with_asked) {
  std::vector<std::size_t> wanted;
  for (std::size_t c = 0; c < columns().size(); ++c)
    if (c < dry_columns || (c < side_columns ? with_water : c < asked_columns ? with_sides : with_asked))
      wanted.push_back(c);
  const hdf5::Lock lock;
  const std::filesystem::path aside = path.string() + ".tmp";
  std::error_code cause;
  try {
    create(aside, rows, wanted);
    std::filesystem::rename(aside, path, cause);
    if (cause) throw error(path.string(), ": cannot replace the file: ", cause.message());
  } catch (const Error&) {
    std::filesystem::remove(aside, cause);
    throw;
  }
  impl_ = std::make_unique<Impl>(
      Impl{hdf5::File::open(path, H5F_ACC_RDWR | H5F_ACC_SWMR_WRITE), wanted, {}, rows});
  for (const std::size_t c : wanted) impl_->datasets.push_back(impl_->file.open_dataset(columns()[c].name));
}

// After a failed append the file is left as a kill would leave it, readable: closing it would declare it
// whole.
Series::~Series() {
  const hdf5::Lock lock;
  if (!impl_ || !impl_->failed) {
    impl_.reset();
    return;
  }
  static auto& failed = *new std::vector<std::unique_ptr<Impl>>;
  failed.push_back(std::move(impl_));
}

void Series::append(const Row& row) {
  const hdf5::Lock lock;
  auto& [file, wanted, datasets, rows, failed] = *impl_;
  const auto numbers = std::bit_cast<Numbers>(row);
  const hsize_t start = rows.size(), one = 1, grown = start + 1;
  const hdf5::Handle memory(H5Screate(H5S_SCALAR), H5Sclose);
  failed = true;  // unless it gets to the end
  for (std::size_t k = 0; k < datasets.size(); ++k) {
    const std::size_t c = wanted[k];
    const char* name = columns()[c].name;
    file.check(H5Dset_extent(datasets[k], &grown), name, "grow");
    const hdf5::Handle space(file.check(H5Dget_space(datasets[k]), name, "grow"), H5Sclose);
    H5Sselect_hyperslab(space, H5S_SELECT_SET, &start, nullptr, &one, nullptr);
    file.check(H5Dwrite(datasets[k], H5T_NATIVE_DOUBLE, memory, space, H5P_DEFAULT, &numbers[c]), name,
               "write");
  }
  file.flush();
  failed = false;
  rows.push_back(row);
}

const std::vector<Row>& Series::rows() const { return impl_->rows; }

std::vector<Row> read_series(const std::filesystem::path& path) {
  const hdf5::Lock lock;
  const auto file = hdf5::File::open(path, H5F_ACC_RDONLY | H5F_ACC_SWMR_READ);
  std::array<std::vector<double>, std::tuple_size_v<Numbers>> numbers;
  std::size_t rows = SIZE_MAX;
  for (std::size_t c = 0; c < numbers.size(); ++c) {
    const bool may_lack = c >= dry_columns;
    if (may_lack && !file.holds(columns()[c].name)) continue;
    file.read(columns()[c].name, numbers[c]);
    rows = std::min(rows, numbers[c].size());  // the last row may be on its way
  }
  std::vector<Row> list;
  for (std::size_t r = 0; r < rows; ++r) {
    Numbers row;
    std::transform(numbers.begin(), numbers.end(), row.begin(),
                   [r](const auto& column) { return r < column.size() ? column[r] : 0; });
    list.push_back(std::bit_cast<Row>(row));
  }
  return list;
}

}  // namespace moraine::output
