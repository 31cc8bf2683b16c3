// Layers that swallow the bed are refused, with what would do; thin beds are warned of.
#include <regex>

#include "dem/packing.hpp"
#include "error.hpp"
#include "program.hpp"
#include "run/layers.hpp"

namespace moraine {
namespace {

constexpr double d = 0.04;

// So many flat layers of nine grains; every fourth is smaller by `ratio` than the others.
dem::State bed_of(int layers, double ratio = 1) {
  std::vector<double> r;
  std::vector<dem::Vec3d> x;
  for (int k = 0; k < layers; ++k)
    for (int n = 0; n < 9; ++n) {
      r.push_back(n % 4 == 1 ? d / 2 / ratio : d / 2);
      x.push_back({d * (n % 3), d * (n / 3), d * (k + 0.5)});
    }
  return dem::grains_at_rest(r, x);
}

cases::Stage stage(double bottom = -1, double top = -1) {
  cases::Stage s{};
  s.name = "one", s.kind = cases::Stage::Kind::shear, s.bottom_layer = bottom, s.top_layer = top;
  return s;
}

std::string refusal(const cases::Stage& s, dem::State grains) {
  try {
    run::choose_layers(s, grains);
  } catch (const Error& e) {
    return e.what();
  }
  return {};
}

TEST(Layers, OfBedsOfOneToSixDiameters) {
  for (int height = 1; height <= 6; ++height)
    for (const double ratio : {1.0, 6.0}) {
      SCOPED_TRACE(std::to_string(height) + " diameters, sizes 1:" + std::to_string(ratio));
      dem::State grains = bed_of(height, ratio);
      const double between = (height - 2) * d / run::mean_diameter(grains) + 1e-9;
      if (height <= 2) {
        const std::string words = refusal(stage(), grains);
        for (const char* word : {"stage one", "no grain is left free", "bottom_layer = 0.04 m",
                                 "top_layer = 0.04 m", "by default", "expected"})
          EXPECT_NE(words.find(word), std::string::npos) << word << " in " << words;
        continue;
      }
      const auto warnings = run::choose_layers(stage(), grains);
      EXPECT_EQ(std::count(grains.part_of.begin(), grains.part_of.end(), dem::BodyId::none),
                9 * (height - 2));
      ASSERT_EQ(warnings.size(), between < 3 ? 1u : 0u);
      if (between < 3) {
        EXPECT_NE(warnings[0].find("mean diameters"), std::string::npos) << warnings[0];
      }
    }
}

// What the error says would do does: thinner layers, or so many grains.
TEST(Layers, TheRemedyWorks) {
  const std::string words = refusal(stage(0.1, 0.12), bed_of(5)), whole = refusal(stage(0.3, -1), bed_of(5));
  EXPECT_EQ(words, "") << "asked for by the case";
  std::smatch found;
  ASSERT_TRUE(std::regex_search(whole, found, std::regex("of at most ([0-9.]+) m"))) << whole;
  const double thinner = 0.999 * std::stod(found[1]);  // as it is printed
  dem::State grains = bed_of(5);
  run::choose_layers(stage(thinner, thinner), grains);
  EXPECT_GE(3 * std::count(grains.part_of.begin(), grains.part_of.end(), dem::BodyId::none), grains.size());

  const std::string low = refusal(stage(), bed_of(2));
  ASSERT_TRUE(std::regex_search(low, found, std::regex("some ([0-9]+) grains"))) << low;
  const int layers = static_cast<int>(std::ceil(std::stod(found[1]) / 9));
  grains = bed_of(layers);
  EXPECT_TRUE(run::choose_layers(stage(), grains).empty()) << layers;
}

// Where the bed is still to come, by the volume of its grains: refused before anything is run or written.
TEST_F(Program, RefusesABedThatItsLayersWillSwallow) {
  const std::string small = small_case();
  const auto with = [&](const std::string& columns) {
    std::string text = small;
    for (const std::string key : {"columns_x", "columns_y"})
      text = std::regex_replace(text, std::regex(key + " = 5"), key + " = " + columns);
    return text;
  };
  const fs::path low = make("low", with("10"));
  for (const char* command : {"run", "check"})
    expect_error({command, low.string(), "--backend", "cpu"},
                 {"stage shear", "no grain will be left free", "bottom_layer = 0.04", "top_layer = 0.04",
                  "grains in this box"});
  EXPECT_FALSE(fs::exists(low / "output"));
  // A thin one is warned of.
  const Outcome thin = moraine({"check", make("thin", with("7")).string(), "--backend", "cpu"});
  EXPECT_EQ(thin.status, 0) << thin.err;
  EXPECT_NE(thin.out.find("mean diameters"), std::string::npos) << thin.out << thin.err;
  const Outcome good = moraine({"check", make("good", small).string(), "--backend", "cpu"});
  EXPECT_EQ(good.out.find("to deform"), std::string::npos) << good.out;
}

// A stage that shears on keeps the layers of the one before, in what is judged before the run, too.
TEST_F(Program, LayersOfAStageThatShearsOn) {
  output::Checkpoint c;
  c.finished = true;
  c.state = dem::grains_at_rest({d / 2, d / 2}, {{0.1, 0.1, d / 2}, {0.1, 0.1, 1.5 * d}});
  c.scene.box = {0.2, 0.2, 0};
  output::write_checkpoint(directory.path() / "two.h5", c);
  const auto shear = [](const std::string& name, const std::string& more) {
    return "[[stage]]\nname = \"" + name + "\"\nkind = \"shear\"\nvelocity = \"1 mm/s\"\n" +
           "duration = 0.01\nnormal_stress = 1000\n" + more;
  };
  const std::string head = "start = \"../two.h5\"\n[contact]\nk_n = 1e6\nk_t = 1e6\n[wall]\nmass = 0.2\n",
                    both = "bottom_layer = 0.03\ntop_layer = 0.03\n",
                    rest =
                        "[[stage]]\nname = \"rest\"\nkind = \"consolidate\"\nnormal_stress = 1000\n"
                        "duration = 0.01\nwall_gamma_n = 20\nwall_gamma_t = 0\n";
  run(make("on", head + shear("one", both) + shear("two", "")));
  const auto log = [&](const char* which) { return contents(directory.path() / which / "output/log.txt"); };
  EXPECT_EQ(log("on").find("do not count"), std::string::npos) << log("on");
  run(make("other", head + shear("one", both) + shear("two", "top_layer = 0.02\n")));
  EXPECT_NE(log("other").find("do not count"), std::string::npos) << log("other");
  // After another stage layers are chosen anew, also from a bed that has been sheared.
  run(make("anew", "start = \"../on\"\n" + head.substr(head.find('\n') + 1) + rest + shear("one", both)));
  EXPECT_EQ(log("anew").find("do not count"), std::string::npos) << log("anew");
}

}  // namespace
}  // namespace moraine
