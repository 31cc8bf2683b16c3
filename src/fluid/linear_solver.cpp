#include "fluid/linear_solver.hpp"

#include <cholmod.h>
#include <sunlinsol/sunlinsol_pcg.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "error.hpp"
#include "fluid/vector.hpp"

namespace moraine::fluid {

namespace {
constexpr std::size_t simplicial_cells = 8000;
}

struct Cholmod::Impl {
  const Darcy& darcy;
  cholmod_common common;
  cholmod_sparse* A = nullptr;
  cholmod_factor* L = nullptr;
  cholmod_dense *X = nullptr, *Y = nullptr, *E = nullptr;
  std::vector<SuiteSparse_long> diagonal;
  std::array<std::vector<SuiteSparse_long>, 3> entry;  // of each face, -1 where it joins no two cells
  std::int64_t factorisations = 0;

  explicit Impl(const Darcy& d) : darcy(d) {
    cholmod_l_start(&common);
    common.print = 0;
    common.quick_return_if_not_posdef = 1;
  }
  ~Impl() {
    cholmod_l_free_dense(&X, &common);
    cholmod_l_free_dense(&Y, &common);
    cholmod_l_free_dense(&E, &common);
    cholmod_l_free_factor(&L, &common);
    cholmod_l_free_sparse(&A, &common);
    cholmod_l_finish(&common);
  }

  // Lower triangle by columns. Cells that meet at two faces (two along a periodic axis) share one entry.
  void analyse() {
    using Index = SuiteSparse_long;
    const std::size_t n = darcy.grid().cells();
    std::vector<std::vector<Index>> below(n);
    const auto each_pair = [&](auto&& visit) {
      for (int a = 0; a < 3; ++a)
        darcy.each_face(a, [&](int, std::size_t f, std::size_t low, std::size_t high) {
          if (low != Darcy::no_cell && high != Darcy::no_cell && low != high)
            visit(a, f, std::min(low, high), static_cast<Index>(std::max(low, high)));
        });
    };
    each_pair([&](int, std::size_t, std::size_t column, Index row) { below[column].push_back(row); });
    std::size_t nonzeros = n;
    for (auto& rows : below) {
      std::sort(rows.begin(), rows.end());
      rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
      nonzeros += rows.size();
    }
    A = cholmod_l_allocate_sparse(n, n, nonzeros, 1, 1, -1, CHOLMOD_REAL, &common);
    if (!A) throw error("pore water: no memory for the matrix of ", n, " cells");
    auto* columns = static_cast<Index*>(A->p);
    auto* rows = static_cast<Index*>(A->i);
    diagonal.resize(n);
    Index next = 0;
    for (std::size_t c = 0; c < n; ++c) {
      columns[c] = diagonal[c] = next;
      rows[next++] = static_cast<Index>(c);
      for (const Index row : below[c]) rows[next++] = row;
    }
    columns[n] = next;
    for (int a = 0; a < 3; ++a) entry[a].assign(darcy.grid().face_count(a), -1);
    each_pair([&](int a, std::size_t f, std::size_t column, Index row) {
      entry[a][f] = std::lower_bound(rows + columns[column], rows + columns[column + 1], row) - rows;
    });
    fill(1);
    // Measured: up to some thousand cells the simplicial factor solves two to three times faster, AMD orders
    // well, and both are made sooner; beyond, blocks and nested dissection win.
    common.supernodal = n <= simplicial_cells ? CHOLMOD_SIMPLICIAL : CHOLMOD_SUPERNODAL;
    common.nmethods = 1;
    common.method[0].ordering = n <= simplicial_cells ? CHOLMOD_AMD : CHOLMOD_METIS;
    L = cholmod_l_analyze(A, &common);
    if (!L) throw error("pore water: CHOLMOD cannot analyse the matrix of ", n, " cells (no memory?)");
  }

  void fill(double s) {
    auto* value = static_cast<double*>(A->x);
    std::fill(value, value + A->nzmax, 0.0);
    const auto& C = darcy.storage();
    for (std::size_t c = 0; c < C.size(); ++c) value[diagonal[c]] = C[c];
    for (int a = 0; a < 3; ++a) {
      const auto& T = darcy.transmissibility(a);
      darcy.each_face(a, [&](int, std::size_t f, std::size_t low, std::size_t high) {
        if (low == high) return;
        const double v = s * T[f];
        if (low != Darcy::no_cell) value[diagonal[low]] += v;
        if (high != Darcy::no_cell) value[diagonal[high]] += v;
        if (entry[a][f] >= 0) value[entry[a][f]] -= v;
      });
    }
  }
};

Cholmod::Cholmod(const Darcy& darcy) : impl_(std::make_unique<Impl>(darcy)) {}
Cholmod::~Cholmod() = default;
std::int64_t Cholmod::factorisations() const { return impl_->factorisations; }
double Cholmod::solves_per_factor() const { return impl_->common.fl / (4 * impl_->common.lnz); }
std::size_t Cholmod::cells() const { return impl_->darcy.grid().cells(); }

void Cholmod::factor(double s) {
  Impl& m = *impl_;
  if (!m.L) m.analyse();
  m.fill(s);
  ++m.factorisations;
  cholmod_l_factorize(m.A, m.L, &m.common);
  if (m.common.status == CHOLMOD_NOT_POSDEF)
    throw error("pore water: the pressure matrix is singular to rounding (step ", s, " s, column ",
                m.L->minor, "); expected a shorter step, less permeability or more compressibility");
  if (m.common.status < CHOLMOD_OK)
    throw error("pore water: CHOLMOD failed with status ", m.common.status,
                m.common.status == CHOLMOD_OUT_OF_MEMORY ? " (no memory)" : "");
}

void Cholmod::solve(const double* b, double* x) {
  Impl& m = *impl_;
  const std::size_t n = cells();
  cholmod_dense B{};
  B.nrow = B.nzmax = B.d = n, B.ncol = 1;
  B.x = const_cast<double*>(b);
  B.xtype = CHOLMOD_REAL, B.dtype = CHOLMOD_DOUBLE;
  if (!cholmod_l_solve2(CHOLMOD_A, m.L, &B, nullptr, &m.X, nullptr, &m.Y, &m.E, &m.common))
    throw error("pore water: CHOLMOD cannot solve, status ", m.common.status);
  std::copy_n(static_cast<const double*>(m.X->x), n, x);
}

namespace {

SUNLinearSolver_Type type_of_cholmod(SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; }
int set_up_cholmod(SUNLinearSolver, SUNMatrix) { return SUNLS_SUCCESS; }
int solve_cholmod(SUNLinearSolver solver, SUNMatrix, N_Vector x, N_Vector b, realtype) {
  try {
    static_cast<Cholmod*>(solver->content)->solve(NV_DATA_S(b), NV_DATA_S(x));
    return SUNLS_SUCCESS;
  } catch (const Error&) {
    return SUNLS_PACKAGE_FAIL_UNREC;
  }
}
int free_cholmod(SUNLinearSolver solver) {
  SUNLinSolFreeEmpty(solver);
  return SUNLS_SUCCESS;
}

// Diffusion number D s/h2 from which CHOLMOD's fixed cost (a solve, and its share of a factor every few
// hundred solves) is less than that of the iterations: bench/results/fluid-times.csv.
double cholmod_from(std::size_t cells) {
  if (cells <= 1000) return 0.1;
  if (cells <= 5000) return 0.3;
  if (cells <= 20000) return 10;
  return std::numeric_limits<double>::infinity();
}

double norm(const double* v, std::size_t n) { return std::sqrt(dot(v, v, n)); }

}  // namespace

SUNLinearSolver make_cholmod_solver(Cholmod& cholmod, SUNContext context) {
  SUNLinearSolver solver = SUNLinSolNewEmpty(context);
  if (!solver) throw error("pore water: no memory for a linear solver");
  solver->ops->gettype = type_of_cholmod;
  solver->ops->setup = set_up_cholmod;
  solver->ops->solve = solve_cholmod;
  solver->ops->free = free_cholmod;
  solver->content = &cholmod;
  return solver;
}

const char* name(Method method) {
  switch (method) {
    case Method::pcg_jacobi:
      return "pcg, jacobi";
    case Method::pcg_cholmod:
      return "pcg, cholmod";
    case Method::cholmod:
      return "cholmod";
  }
  return "";
}

struct LinearSolver::Impl {
  const Darcy& darcy;
  const SolverOptions options;
  const std::size_t n;
  SUNContext context = nullptr;
  N_Vector b = nullptr, x = nullptr;  // b borrows the caller's array
  SUNLinearSolver pcg = nullptr;
  Cholmod cholmod;
  Method method = Method::pcg_jacobi;
  std::vector<double> inverse_diagonal, residual, correction;
  double largest_diagonal = 0;
  std::uint64_t version = 0, factor_version = 0;
  double s = -1, factor_s = -1;
  std::int64_t solves = 0, iterations = 0;

  Impl(const Darcy& d, const SolverOptions& o) : darcy(d), options(o), n(d.grid().cells()), cholmod(d) {
    if (!(o.tolerance > 0 && o.tolerance < 1))
      throw error("pore water: solver tolerance ", o.tolerance, "; expected more than 0 and less than 1");
    if (o.max_iterations < 1)
      throw error("pore water: ", o.max_iterations, " iterations at most; expected one or more");
    inverse_diagonal.assign(n, 0), residual.assign(n, 0), correction.assign(n, 0);
    SUNContext_Create(nullptr, &context);
    b = N_VNewEmpty_Serial(static_cast<sunindextype>(n), context);
    x = new_vector(n, context);
    pcg = SUNLinSol_PCG(x, SUN_PREC_LEFT, o.max_iterations, context);
    if (!b || !pcg) throw error("pore water: no memory for the linear solver of ", n, " cells");
    SUNLinSolSetATimes(pcg, this, multiply);
    SUNLinSolSetPreconditioner(pcg, this, nullptr, precondition);
    SUNLinSolInitialize(pcg);
  }
  ~Impl() {
    SUNLinSolFree(pcg);
    N_VDestroy(x);
    N_VDestroy(b);
    SUNContext_Free(&context);
  }

  static int multiply(void* self, N_Vector v, N_Vector out) {
    const Impl& m = *static_cast<Impl*>(self);
    m.darcy.apply(m.s, NV_DATA_S(v), NV_DATA_S(out));
    return 0;
  }
  static int precondition(void* self, N_Vector r, N_Vector z, realtype, int) {
    const Impl& m = *static_cast<Impl*>(self);
    const double *from = NV_DATA_S(r), *scale = m.inverse_diagonal.data();
    double* to = NV_DATA_S(z);
    for (std::size_t i = 0; i < m.n; ++i) to[i] = from[i] * scale[i];
    return 0;
  }

  void prepare(double step) {
    if (step == s && version == darcy.version()) return;
    s = step, version = 0;  // until all is made
    darcy.diagonal(s, inverse_diagonal.data());
    double number = 0;  // diagonal of s L over that of C: 6 D s/h2 in cubes
    largest_diagonal = 0;
    for (std::size_t i = 0; i < n; ++i) {
      largest_diagonal = std::max(largest_diagonal, inverse_diagonal[i]);
      number = std::max(number, inverse_diagonal[i] / darcy.storage()[i] - 1);
      inverse_diagonal[i] = 1 / inverse_diagonal[i];
    }
    switch (options.choice) {
      case SolverChoice::pcg:
        method = Method::pcg_jacobi;
        break;
      case SolverChoice::cholmod:
        method = Method::cholmod;
        break;
      case SolverChoice::automatic:
        method = number / 6 > cholmod_from(n) ? Method::cholmod : Method::pcg_jacobi;
        break;
    }
    if (method != Method::pcg_jacobi && (factor_s != s || factor_version != darcy.version())) {
      factor_version = 0;
      cholmod.factor(s);
      factor_s = s, factor_version = darcy.version();
    }
    version = darcy.version();
  }

  [[noreturn]] void give_up(std::int64_t count, double reached, double target) const {
    throw error("pore water: the pressure solver (", name(method), ") did not converge in ", count,
                " iterations: residual ", reached, " m3, expected ", target, " m3; try solver = \"cholmod\"");
  }

  // What rounding leaves in b - A x: a few units in the last place of the largest products.
  double floor() const {
    return 8 * std::numeric_limits<double>::epsilon() * largest_diagonal * norm(NV_DATA_S(x), n);
  }

  void solve_pcg(const double* rhs, double target) {
    NV_DATA_S(b) = const_cast<double*>(rhs);
    const int flag = SUNLinSolSolve(pcg, nullptr, x, b, target);
    const std::int64_t count = SUNLinSolNumIters(pcg);
    iterations += count;
    NV_DATA_S(b) = nullptr;
    if (flag == SUNLS_SUCCESS) return;
    const double reached = SUNLinSolResNorm(pcg);
    if (!(reached <= std::max(target, floor()))) give_up(count, reached, target);
  }

  void solve_direct(const double* rhs, double target) {
    double* p = NV_DATA_S(x);
    for (int count = 0;; ++count) {
      darcy.apply(s, p, residual.data());
      for (std::size_t i = 0; i < n; ++i) residual[i] = rhs[i] - residual[i];
      const double reached = norm(residual.data(), n);
      if (reached <= target || (count > 0 && reached <= floor())) return;
      if (count == 5 || !std::isfinite(reached)) give_up(count, reached, target);
      cholmod.solve(residual.data(), correction.data());
      for (std::size_t i = 0; i < n; ++i) p[i] += correction[i];
      ++iterations;
    }
  }
};

LinearSolver::LinearSolver(const Darcy& darcy, const SolverOptions& options)
    : impl_(std::make_unique<Impl>(darcy, options)) {}
LinearSolver::~LinearSolver() = default;
Method LinearSolver::method() const { return impl_->method; }
std::int64_t LinearSolver::solves() const { return impl_->solves; }
std::int64_t LinearSolver::iterations() const { return impl_->iterations; }
std::int64_t LinearSolver::factorisations() const { return impl_->cholmod.factorisations(); }

void LinearSolver::solve(double s, const double* b, double* x) {
  Impl& m = *impl_;
  m.prepare(s);
  ++m.solves;
  const double size = norm(b, m.n);
  if (!std::isfinite(size)) throw error("pore water: the right-hand side of the pressure step is not finite");
  if (size == 0) {
    std::fill_n(x, m.n, 0.0);
    return;
  }
  std::copy_n(x, m.n, NV_DATA_S(m.x));
  if (m.method == Method::cholmod)
    m.solve_direct(b, m.options.tolerance * size);
  else
    m.solve_pcg(b, m.options.tolerance * size);
  std::copy_n(NV_DATA_S(m.x), m.n, x);
}

}  // namespace moraine::fluid
