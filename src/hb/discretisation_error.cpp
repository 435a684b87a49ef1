#include "hb/discretisation_error.h"

#include <algorithm>

#include "error.h"
#include "hb/diagnostics.h"
#include "log.h"
#include "solve/memory.h"
#include "solve/vectors.h"
#include "tuned.h"

namespace fretwave::hb {

namespace {

const Tuned tolerance("error_tolerance", 1e-3,
                      "relative residual of the linear systems: errors move by 1 % at most");
const Tuned memory_share("error_memory_share", 0.5, "share of the free memory that the factors may take");
const Tuned negligible("error_negligible", 1e-6,
                       "share of the residual, up to which a source is not solved for");
const Tuned reach("error_reach", 0.3, "arclength by which the branch is followed to the same parameter");

/// Whether it is so for the contacts of all ranks.
template <class Predicate>
bool all_laws(model::Model const& model, Predicate is) {
  int every = 1;
  for (auto const& contact : model.contacts()) every = every && is(*contact.law);
  MPI_Allreduce(MPI_IN_PLACE, &every, 1, MPI_INT, MPI_LAND, model.comm());
  return every;
}

/// Up to 2 H + 1, odd orders alone where no others arise.
std::vector<int> enlarged(Harmonics const& h, model::Model const& model) {
  const bool odd = h.odd_only() && all_laws(model, [](auto const& law) { return law.odd(); });
  const int step = odd ? 2 : 1;
  std::vector<int> orders;
  for (int n = step - 1; n <= 2 * h.highest() + 1; n += step) orders.push_back(n);
  return orders;
}

std::unique_ptr<HarmonicProblem> refined(HarmonicProblem const& problem, std::vector<int> const& orders,
                                         int samples) {
  auto out = problem.on(Harmonics(orders, samples, problem.harmonics().highest()));
  if (!out)
    throw InputError("the problem has no discretisation to be refined", "a way to another problem",
                     "a nonlinear mode or a forced response", "estimate the error of its goal");
  return out;
}

/// A complex factor for each order: of reduced models dense, else filled twelvefold, as of three-dimensional
/// meshes.
double factor_bytes(model::Model const& model, size_t orders) {
  const double dense = double(model.dofs()) * double(model.dofs());
  return sizeof(complex) * double(orders) * std::min(12 * model.largest_term(), dense);
}

}  // namespace

DiscretisationError::DiscretisationError(HarmonicProblem& problem, std::string const& prefix)
    : problem_(problem) {
  const std::vector<int> orders = enlarged(problem.harmonics(), problem.model());
  const double bytes = factor_bytes(problem.model(), orders.size()),
               free = solve::available_bytes(problem.comm());
  if (bytes > memory_share * free) {
    left_out_ = "factors of " + std::to_string(orders.size()) + " harmonics would take about " +
                solve::gigabytes(bytes) + ", of " + solve::gigabytes(free) + " free";
    return;
  }
  finer_ = refined(problem, orders, std::max(4 * problem.harmonics().samples(), 16 * orders.back()));
  finer_->terms().multiply_exactly();  // an error is a small difference
  newton_ = std::make_unique<solve::Newton>(*finer_, prefix);
  newton_->solve_beside(tolerance);
}

/// The rows of the finer equations that the problem itself has, the others zero.
VecHandle DiscretisationError::retained(Vec r) const {
  return embedded(problem_, *finer_, embedded(*finer_, problem_, r));
}

/// -r, and zero in the closing row.
VecHandle DiscretisationError::right_side(Vec r) const {
  VecHandle b = solve::zero_like(finer_->unknowns());
  const PetscInt n = local_size(r);
  const ReadArray in(r);
  const WriteArray out(b);
  std::transform(in.data(), in.data() + n, out.data(), [](double v) { return -v; });
  return b;
}

void DiscretisationError::close(Vec y, Vec tangent) {
  VecHandle weights = problem_.unknowns();
  problem_.metric(y, weights);
  newton_->system().close(embedded(problem_, *finer_, solve::weighted(weights, tangent)), 0);
}

namespace {

/// Scalars of dy' + s t without a change of the last of `count`, the parameter.
std::vector<double> at_parameter(std::vector<double> change, std::vector<double> const& tangent, int count) {
  const double farthest = reach, s = std::clamp(-change[count - 1] / tangent[count - 1], -farthest, farthest);
  for (size_t j = 0; j < change.size(); ++j) change[j] += s * tangent[j];
  return change;
}

}  // namespace

std::optional<LeftOut> DiscretisationError::at(Vec y, Vec tangent) {
  if (!finer_) return {};
  static const log::Event estimate("FwErrorEstimate");
  const log::Span span(estimate);
  VecHandle r = problem_.equations(), finer = finer_->equations();
  problem_.residual(y, r);
  VecHandle point = embedded(problem_, *finer_, y), left = embedded(problem_, *finer_, r);
  check(VecScale(left, problem_.stiffness_scale() / finer_->stiffness_scale()));
  finer_->residual(point, finer);
  VecHandle same = retained(finer);
  check(VecAXPY(finer, -1, same));  // harmonics: r'_new
  check(VecAXPY(same, -1, left));   // samples: r'_old - r
  Vec const residuals[] = {finer, same, left};
  double sizes[3], sum = 0;
  for (size_t k = 0; k < 3; ++k) sum += sizes[k] = solve::norm(residuals[k]);
  std::vector<VecHandle> rights, changes;
  std::vector<Vec> b, x;
  std::vector<size_t> sources;
  for (size_t k = 0; k < 3; ++k) {
    if (sizes[k] <= negligible * sum) continue;
    rights.push_back(right_side(residuals[k])), changes.push_back(solve::zero_like(rights.back()));
    b.push_back(rights.back()), x.push_back(changes.back()), sources.push_back(k);
  }
  LeftOut out;
  close(y, tangent);
  if (!newton_->linear(point, b, x)) return {};
  const auto along = problem_.scalars(tangent);
  const auto change = [&](Vec v) { return at_parameter(finer_->scalars(v), along, problem_.scalar_count()); };
  std::vector<double>* const by_source[] = {&out.harmonics, &out.samples, &out.solver};
  for (size_t k = 0; k < x.size(); ++k) *by_source[sources[k]] = change(x[k]);
  for (size_t k = 1; k < x.size(); ++k) check(VecAXPY(x[0], 1, x[k]));
  out.all = x.empty() ? std::vector<double>(along.size(), 0.0) : change(x[0]);
  for (size_t k = 0; k < 3; ++k)  // by the size of its residual
    if (by_source[k]->empty()) {
      *by_source[k] = out.all;
      for (double& v : *by_source[k]) v *= sum > 0 ? sizes[k] / sum : 0;
    }
  return out;
}

}  // namespace fretwave::hb
