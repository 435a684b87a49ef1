#include "hb/discretisation_error.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <numeric>

#include "error.h"
#include "hb/at_parameter.h"
#include "hb/diagnostics.h"
#include "log.h"
#include "solve/memory.h"
#include "solve/preconditioner.h"
#include "solve/vectors.h"
#include "tuned.h"

namespace fretwave::hb {

namespace {

const Tuned tolerance("error_tolerance", 1e-3,
                      "relative residual of the linear systems: errors move by 1 % at most", 1);
const Tuned memory_share("error_memory_share", 0.5, "share of the free memory that estimates may take");
constexpr double vectors = 70;  // of a problem: its own, and for each GMRES iteration two
const Tuned negligible("error_negligible", 1e-6,
                       "share of the residual, up to which a source is not solved for");
const Tuned least("error_least", 17, "highest order that estimates take in at the least");
const Tuned cheap("error_cheap", 1e4, "unknowns of these up to which it is so for three harmonics and less");
const Tuned bent("error_bent", 0.2,
                 "residual that a step leaves along that which it is made for, from which it is taken anew");

constexpr double aside = 1e-2;   // arclength from a point to where residuals tell how the branch bends
constexpr double solved = 1e-2;  // of the residual: so far Newton goes on from a bent step
constexpr double astray = 10;    // of that step: what lies farther away is another solution
const Tuned most_steps("error_steps", 20, "Newton steps at most that go on from a bent one");

const Tuned held("error_held_means", 1e-4,
                 "share of the stuck stiffness in which estimates hold the mean of the motion");

/// Whether it is so for the contacts of all ranks.
template <class Predicate>
bool all_laws(model::Model const& model, Predicate is) {
  int every = 1;
  for (auto const& contact : model.contacts()) every = every && is(*contact.law);
  MPI_Allreduce(MPI_IN_PLACE, &every, 1, MPI_INT, MPI_LAND, model.comm());
  return every;
}

/// Highest orders to estimate with, the best one first: `least` at least, where a few harmonics are not dear,
/// for high ones that resonate move each other more than those next to H tell; H + max(4, 3 H / 4), at most
/// 2 H + 1.
std::vector<int> reaches(Harmonics const& h, model::Model const& model) {
  const int H = h.highest(), near = H + std::min(H + 1, std::max(4, (3 * H + 3) / 4)), far = least;
  if (near >= far || (H <= 3 && double(model.dofs()) * (2 * far + 1) > cheap)) return {near};
  return {far, near};
}

/// Odd orders alone where no others arise.
std::vector<int> orders_up_to(int highest, Harmonics const& h, model::Model const& model) {
  const bool odd = h.odd_only() && all_laws(model, [](auto const& law) { return law.odd(); });
  std::vector<int> orders;
  for (int n = odd ? 1 : 0; n <= highest; n += odd ? 2 : 1) orders.push_back(n);
  return orders;
}

std::unique_ptr<HarmonicProblem> refined(HarmonicProblem const& problem, std::vector<int> const& orders,
                                         int samples, int moving) {
  auto out = problem.on(Harmonics(orders, samples, moving));
  if (!out)
    throw InputError("the problem has no discretisation to be refined", "a way to another problem",
                     "a nonlinear mode or a forced response", "estimate the error of its goal");
  out->terms().multiply_exactly();  // an error is a small difference
  out->terms().hold_means(held, out->stiffness_scale());
  return out;
}

/// Of a complex factor for each order: of reduced models dense, else filled twelvefold, as of
/// three-dimensional meshes.
double factor_bytes(HarmonicProblem const& problem) {
  const double n = double(problem.model().dofs());
  return sizeof(complex) * double(problem.harmonics().count()) *
         std::min(12 * problem.model().largest_term(), n * n);
}

/// What is beyond the memory that `problems` like this may take, so many of them with factors; 0 if nothing
/// is. Where all harmonics have one factor their vectors count. Collective.
double bytes_beyond(HarmonicProblem& problem, int problems, int factors = 1) {
  const double most = memory_share * solve::available_bytes(problem.comm());
  double bytes = factors * factor_bytes(problem);
  if (bytes <= most) return 0;
  if (auto const* kind = solve::choose_kind(problem, "auto").kind; kind && kind->one_factor)
    bytes = sizeof(double) * problems * vectors * double(problem.model().dofs()) *
            problem.harmonics().block_size();
  return bytes > most ? bytes : 0;
}

}  // namespace

DiscretisationError::DiscretisationError(HarmonicProblem& problem, std::string const& prefix)
    : problem_(problem), prefix_(prefix) {
  std::vector<int> orders;
  int samples = 0;
  double bytes = 0;
  const std::vector<int> all = reaches(problem.harmonics(), problem.model());
  for (int highest : all) {
    orders = orders_up_to(highest, problem.harmonics(), problem.model());
    samples = std::max(4 * problem.harmonics().samples(), 16 * orders.back());
    finer_ = refined(problem, orders, samples, problem.harmonics().highest());
    // the larger set is not to take the room of what follows a bent step
    if (bytes = bytes_beyond(*finer_, 2, highest == all.back() ? 1 : 2); bytes == 0) break;
    finer_.reset();
  }
  if (!finer_) {
    left_out_ = "systems of " + std::to_string(orders.size()) + " harmonics would take about " +
                solve::gigabytes(bytes) + ", of " + solve::gigabytes(solve::available_bytes(problem.comm())) +
                " free";
    return;
  }
  of_velocity_ = !all_laws(problem.model(), [](auto const& law) { return !law.uses_velocity(); });
  moved_ = refined(problem, orders, samples, orders.back());
  newton_ = std::make_unique<solve::Newton>(*finer_, prefix);
  newton_->solve_beside(tolerance);
}

/// The rows of the finer equations that the problem itself has, the others zero.
VecHandle DiscretisationError::retained(Vec r) const {
  return embedded(problem_, *finer_, embedded(*finer_, problem_, r));
}

namespace {

/// -v where v and `out` have entries both: one of them has the closing row.
VecHandle negated(Vec v, VecHandle out) {
  const PetscInt n = std::min(local_size(v), local_size(out));
  const ReadArray in(v);
  const WriteArray written(out);
  std::transform(in.data(), in.data() + n, written.data(), std::negate());
  return out;
}

}  // namespace

/// -r, and zero in the closing row.
VecHandle DiscretisationError::right_side(Vec r) const {
  return negated(r, solve::zero_like(finer_->unknowns()));
}

/// The inverse: r of -r.
VecHandle DiscretisationError::left_side(Vec b) const { return negated(b, finer_->equations()); }

VecHandle DiscretisationError::closing_row(Vec y, Vec tangent) {
  VecHandle weights = problem_.unknowns();
  problem_.metric(y, weights);
  return embedded(problem_, *finer_, solve::weighted(weights, tangent));
}

/// A residual of `moved_` over the same of `finer_`: solutions leave there what they measure forces in.
double DiscretisationError::to_moved() const { return finer_->stiffness_scale() / moved_->stiffness_scale(); }

/// c, from no farther away than the branch is taken to be straight.
double DiscretisationError::bend(Vec point, Vec r, Vec reduction, Vec step) {
  VecHandle weights = finer_->unknowns(), there = moved_->equations();
  finer_->metric(point, weights);
  const double t = std::min(1.0, farthest() / solve::weighted_norm(weights, step));
  moved_->residual(solve::moved(point, t, step), there);
  const double along = (solve::dot(there, r) / to_moved() + solve::dot(reduction, r)) / solve::dot(r, r);
  return (along - (1 - t)) / (t * t);
}

/// Of the parameter by the arclength s, of y'': J' y'' = -F'' t t, at a right angle to t, with F'' from
/// residuals on both sides. Zero where J' is singular.
double DiscretisationError::curvature(Vec point, Vec row, Vec tangent) {
  VecHandle along = embedded(problem_, *finer_, tangent), curved = finer_->equations();
  VecHandle beside = finer_->equations();
  finer_->residual(point, curved);
  check(VecScale(curved, -2));
  for (double s : {aside, -aside}) {
    finer_->residual(solve::moved(point, s, along), beside);
    check(VecAXPY(curved, 1, beside));
  }
  check(VecScale(curved, 1 / (aside * aside)));
  VecHandle b = right_side(curved), second = solve::zero_like(b);
  newton_->system().close(row, 0);
  const std::array<Vec, 1> right = {b}, left = {second};
  return newton_->linear(point, right, left) ? finer_->scalars(second)[problem_.scalar_count() - 1] : 0;
}

/// The step with the Jacobian halfway to where it leads; as it was where that is singular, or its factors do
/// not fit the memory beside the others.
void DiscretisationError::from_halfway(Vec middle, Vec row, std::span<Vec const> b, std::span<Vec const> x) {
  if (!again_) {
    if (bytes_beyond(*moved_, 1) > 0) return;
    again_ = std::make_unique<solve::Newton>(*moved_, prefix_);
    again_->solve_beside(tolerance);
  }
  again_->scale(middle);  // whatever those before were measured in
  std::vector<VecHandle> before, scaled;
  std::vector<Vec> rights;
  for (Vec part : x) before.push_back(solve::copy(part));
  for (Vec part : b) {
    scaled.push_back(solve::copy(part)), rights.push_back(scaled.back());
    check(VecScale(rights.back(), to_moved()));
  }
  again_->system().close(row, 0);
  if (again_->linear(middle, rights, x)) return;
  for (size_t k = 0; k < x.size(); ++k) check(VecCopy(before[k], x[k]));
}

namespace {

/// Of a step: where 1 - s + c s^2 first vanishes, or else is the least.
double step_length(double c) { return c > 0.25 ? 1 / (2 * c) : 2 / (1 + std::sqrt(1 - 4 * c)); }

VecHandle sum(std::span<Vec const> parts) {
  VecHandle all = solve::copy(parts[0]);
  for (Vec part : parts.subspan(1)) check(VecAXPY(all, 1, part));
  return all;
}

}  // namespace

/// r' of the point, by what is left out.
std::array<VecHandle, 4> DiscretisationError::residuals(Vec y, Vec point, Vec reduction) {
  VecHandle r = problem_.equations(), finer = finer_->equations();
  problem_.residual(y, r);
  VecHandle left = embedded(problem_, *finer_, r);
  VecHandle reduced = reduction ? embedded(problem_, *finer_, reduction) : solve::zero_like(finer);
  for (Vec coarse : {Vec(left), Vec(reduced)})
    check(VecScale(coarse, problem_.stiffness_scale() / finer_->stiffness_scale()));
  finer_->residual(point, finer);
  VecHandle same = retained(finer);
  check(VecAXPY(finer, -1, same));  // harmonics: r'_new
  check(VecAXPY(same, -1, left));   // samples: r'_old - r
  return {std::move(finer), std::move(same), std::move(left), std::move(reduced)};
}

/// dy' of these right sides, and whether it was bent; none where J' is singular.
std::optional<bool> DiscretisationError::step(Vec point, Vec row, Vec reduction, std::span<Vec const> b,
                                              std::span<Vec const> x) {
  newton_->system().close(row, 0);
  if (!newton_->linear(point, b, x)) return {};
  if (b.empty()) return false;
  VecHandle whole = sum(x);
  const double c = bend(point, left_side(sum(b)), reduction, whole);
  if (!std::isfinite(c)) return false;
  const double length = step_length(c);
  for (Vec part : x) check(VecScale(part, length));
  if (std::abs(c) <= bent) return false;
  from_halfway(solve::moved(point, length / 2, whole), row, b, x);
  return true;
}

/// Newton's steps from where these led, until next to nothing is left of the residual: `most`, what the most
/// is left out by, gets what they change. None where a step is dear, and where they lead to another solution
/// or nowhere.
void DiscretisationError::finish(Vec point, Vec row, double residual, std::span<Vec const> x, Vec most) {
  if (!again_ || again_->dear()) return;
  VecHandle whole = sum(x), y = solve::moved(point, 1, whole);
  again_->scale(y);  // before it is said how far to go
  check(SNESSetTolerances(again_->snes(), solved * to_moved() * residual, PETSC_DEFAULT, PETSC_DEFAULT,
                          most_steps.count(), PETSC_DEFAULT));
  again_->system().close(row, solve::dot(row, point));
  const bool found = again_->solve(y, solve::Effort::brief).converged;
  check(VecAXPY(y, -1, point));
  if (!found || solve::norm(y) > astray * solve::norm(whole)) return;
  check(VecAXPY(y, -1, whole));
  check(VecAXPY(most, 1, y));
}

namespace {
constexpr size_t above = 0, reduced = 3;  // among the sources
}

std::optional<LeftOut> DiscretisationError::at(Vec y, Vec tangent, Vec reduction) {
  if (!finer_) return {};
  static const log::Event estimate("FwErrorEstimate");
  const log::Span span(estimate);
  VecHandle point = embedded(problem_, *finer_, y);
  const auto left = residuals(y, point, reduction);
  std::array<double, 4> sizes;
  std::transform(left.begin(), left.end(), sizes.begin(), [](Vec r) { return solve::norm(r); });
  const double total = std::accumulate(sizes.begin(), sizes.end(), 0.0);
  std::vector<VecHandle> rights, changes;
  std::vector<Vec> b, x;
  std::vector<size_t> sources;
  for (size_t k = 0; k < left.size(); ++k) {
    // a reduction's residual is small for its effect: it lies in the fundamental
    if (sizes[k] <= (k == reduced ? 0 : negligible * total)) continue;
    rights.push_back(right_side(left[k])), changes.push_back(solve::zero_like(rights.back()));
    b.push_back(rights.back()), x.push_back(changes.back()), sources.push_back(k);
  }
  VecHandle row = closing_row(y, tangent);
  const auto is_bent = step(point, row, left[reduced], b, x);
  if (!is_bent) return {};
  if (*is_bent && sources[0] != reduced) {
    // what a reduction leaves out, the last of the sources, is in none of these equations
    const auto end = std::ranges::find(sources, reduced);
    const auto larger = [&](size_t one, size_t other) { return sizes[one] < sizes[other]; };
    const auto most = std::max_element(sources.begin(), end, larger) - sources.begin();
    finish(point, row, solve::norm(sum(b)), std::span(x).first(end - sources.begin()), x[most]);
  }
  if (!sources.empty() && sources[0] == above) check(VecScale(x[0], all_above(left[above])));
  LeftOut out;
  const auto along = problem_.scalars(tangent);
  std::optional<double> found;
  const auto curvature = [&] { return found ? *found : *(found = this->curvature(point, row, tangent)); };
  const auto change = [&](Vec v) {
    return at_parameter(finer_->scalars(v), along, curvature, problem_.scalar_count());
  };
  for (size_t k = 0; k < x.size(); ++k) out.by_source[sources[k]] = change(x[k]);
  out.all = x.empty() ? std::vector<double>(along.size(), 0.0) : change(sum(x));
  for (size_t k = 0; k < left.size(); ++k)  // by the size of its residual
    if (out.by_source[k].empty()) {
      out.by_source[k] = out.all;
      for (double& v : out.by_source[k]) v *= total > 0 ? sizes[k] / total : 0;
    }
  return out;
}

}  // namespace fretwave::hb
