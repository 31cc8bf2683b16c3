#include "fluid/linear_solver.hpp"

#include <cholmod.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_pcg.h>

#include <algorithm>

#include "error.hpp"

namespace moraine::fluid {

namespace {

struct Cholmod {
  const System& system;
  cholmod_common common;
  cholmod_sparse* matrix = nullptr;
  cholmod_factor* factor = nullptr;
  cholmod_dense *x = nullptr, *y = nullptr, *e = nullptr;  // work space of solve2
  std::int64_t factorisations = 0;
  int last_flag = 0;

  explicit Cholmod(const System& s) : system(s) {
    cholmod_l_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_AUTO;
  }
  ~Cholmod() {
    cholmod_l_free_dense(&x, &common), cholmod_l_free_dense(&y, &common), cholmod_l_free_dense(&e, &common);
    cholmod_l_free_factor(&factor, &common), cholmod_l_free_sparse(&matrix, &common);
    cholmod_l_finish(&common);
  }

  // Lower triangle, columns in order. Two links to one neighbour (an axis of two periodic cells) are added
  // up.
  void assemble() {
    const Darcy& d = *system.darcy;
    const std::size_t n = d.storage().size();
    if (!matrix) matrix = cholmod_l_allocate_sparse(n, n, 4 * n + 3 * n, 1, 1, -1, CHOLMOD_REAL, &common);
    auto* const begin = static_cast<std::int64_t*>(matrix->p);
    auto* const row = static_cast<std::int64_t*>(matrix->i);
    auto* const value = static_cast<double*>(matrix->x);
    std::int64_t used = 0;
    for (std::size_t c = 0; c < n; ++c) {
      begin[c] = used;
      double self = system.w * d.storage()[c] + system.dt * d.outflow()[c];
      row[used] = static_cast<std::int64_t>(c);
      const std::int64_t self_at = used++;
      for (int k = 0; k < 6; ++k) {
        const std::int64_t other = d.neighbours(c)[k];
        const double t = -system.dt * d.links(c)[k];
        if (other == static_cast<std::int64_t>(c)) self += t;
        if (other <= static_cast<std::int64_t>(c)) continue;
        std::int64_t at = used;  // kept in order
        while (at > self_at + 1 && row[at - 1] > other) --at;
        if (at > self_at + 1 && row[at - 1] == other) {
          value[at - 1] += t;
          continue;
        }
        for (std::int64_t move = used++; move > at; --move)
          row[move] = row[move - 1], value[move] = value[move - 1];
        row[at] = other, value[at] = t;
      }
      value[self_at] = self;
    }
    begin[n] = used;
  }
  bool factorise() {
    assemble();
    if (!factor) factor = cholmod_l_analyze(matrix, &common);
    ++factorisations;
    return cholmod_l_factorize(matrix, factor, &common) && common.status == CHOLMOD_OK;
  }
  bool solve(N_Vector to, N_Vector from) {
    const auto n = static_cast<std::size_t>(NV_LENGTH_S(from));
    cholmod_dense b{};
    b.nrow = b.nzmax = b.d = n, b.ncol = 1, b.x = NV_DATA_S(from), b.xtype = CHOLMOD_REAL,
    b.dtype = CHOLMOD_DOUBLE;
    if (!cholmod_l_solve2(CHOLMOD_A, factor, &b, nullptr, &x, nullptr, &y, &e, &common)) return false;
    std::copy_n(static_cast<double*>(x->x), n, NV_DATA_S(to));
    return true;
  }
};

Cholmod& cholmod_of(SUNLinearSolver s) { return *static_cast<Cholmod*>(s->content); }

int multiply(void* data, N_Vector x, N_Vector y) {
  const auto& s = *static_cast<System*>(data);
  s.darcy->apply(s.w, s.dt, NV_DATA_S(x), NV_DATA_S(y));
  return 0;
}
int divide_by_diagonal(void* data, N_Vector r, N_Vector z, realtype, int) {
  const auto& s = *static_cast<System*>(data);
  const std::vector<double>&c = s.darcy->storage(), &out = s.darcy->outflow();
  for (std::size_t k = 0; k < c.size(); ++k) NV_DATA_S(z)[k] = NV_DATA_S(r)[k] / (s.w * c[k] + s.dt * out[k]);
  return 0;
}

}  // namespace

Owned<SUNContext, FreeContext> make_context() {
  SUNContext context = nullptr;
  if (SUNContext_Create(nullptr, &context) != 0) throw error("pore water: SUNDIALS cannot start");
  return Owned<SUNContext, FreeContext>(context);
}

Owned<N_Vector, FreeVector> make_vector(std::size_t n, SUNContext context) {
  Owned<N_Vector, FreeVector> v(N_VNew_Serial(static_cast<sunindextype>(n), context));
  if (!v) throw error("pore water: no memory for ", n, " cells");
  v->ops->nvdotprod = [](N_Vector a, N_Vector b) {
    const double *const x = NV_DATA_S(a), *const y = NV_DATA_S(b);
    const sunindextype size = NV_LENGTH_S(a);
    double sum[8] = {};
    sunindextype k = 0;
    for (; k + 8 <= size; k += 8)
      for (int lane = 0; lane < 8; ++lane) sum[lane] += x[k + lane] * y[k + lane];
    for (int lane = 0; k < size; ++k, ++lane) sum[lane] += x[k] * y[k];
    return ((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7]));
  };
  return v;
}

Owned<SUNLinearSolver, FreeSolver> make_cholmod(const System& system, SUNContext context) {
  SUNLinearSolver s = SUNLinSolNewEmpty(context);
  s->content = new Cholmod(system);
  s->ops->gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_MATRIX_EMBEDDED; };
  s->ops->setup = [](SUNLinearSolver self, SUNMatrix) {
    return cholmod_of(self).last_flag = cholmod_of(self).factorise() ? 0 : SUNLS_PACKAGE_FAIL_UNREC;
  };
  s->ops->solve = [](SUNLinearSolver self, SUNMatrix, N_Vector x, N_Vector b, realtype) {
    return cholmod_of(self).last_flag = cholmod_of(self).solve(x, b) ? 0 : SUNLS_PACKAGE_FAIL_UNREC;
  };
  s->ops->lastflag = [](SUNLinearSolver self) {
    return static_cast<sunindextype>(cholmod_of(self).last_flag);
  };
  s->ops->free = [](SUNLinearSolver self) {
    delete &cholmod_of(self);
    self->content = nullptr;
    SUNLinSolFreeEmpty(self);
    return 0;
  };
  return Owned<SUNLinearSolver, FreeSolver>(s);
}

std::int64_t cholmod_factorisations(SUNLinearSolver solver) { return cholmod_of(solver).factorisations; }

Owned<SUNLinearSolver, FreeSolver> make_pcg(System& system, N_Vector like, int max_iterations,
                                            SUNContext context) {
  SUNLinearSolver s = SUNLinSol_PCG(like, SUN_PREC_LEFT, max_iterations, context);
  if (!s) throw error("pore water: SUNDIALS cannot make its PCG solver");
  SUNLinSolSetATimes(s, &system, multiply);
  SUNLinSolSetPreconditioner(s, &system, nullptr, divide_by_diagonal);
  if (SUNLinSolInitialize(s) != 0) throw error("pore water: SUNDIALS cannot start its PCG solver");
  return Owned<SUNLinearSolver, FreeSolver>(s);
}

}  // namespace moraine::fluid
