#include "solve/continuation.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "tuned.h"

namespace fretwave::solve {

namespace {

const Tuned kink_length("branch_kink_length", 1e-4,
                        "step in which a turn is a kink (a sample changes state), not curvature");
const Tuned crawl("branch_crawl", 300, "steps below the smallest in a row, over pieces that thin");
const Tuned often("branch_often", 0.3, "share of a step: a shorter one has failed twice");
const Tuned before_end("branch_before_end", 0.999, "share of the way to the end of a piece");
const Tuned seen_angle("branch_seen_angle", 0.05,
                       "turn [rad] at a corner, below which pieces are no longer walked one by one");
const Tuned unturned("branch_unturned", 0.01,
                     "share of a step: the way aside that the tangents need not tell of");
const Tuned easy("branch_easy", 5, "Newton iterations; after more the corrector may be on another branch");
const Tuned grid("branch_grid", 16, "lengths of steps in every factor of two");

/// On a coarse grid: what a solution's last digits (of which no two numbers of ranks have the same) do to a
/// length would be handed on from step to step and grow with the steps.
double on_grid(double length) { return std::exp2(std::round(grid * std::log2(length)) / grid); }
constexpr double end_known = 1e-4;  // arclength: so near to what is no solution a branch ends
constexpr double shorter = 0.75;    // of the step tried before, one that is tried again

}  // namespace

Continuation::Continuation(Problem& problem, std::string const& prefix, double low, double high,
                           StepControl steps, std::vector<double> report_at)
    : problem_(problem),
      newton_(problem, prefix),
      given_low_(low),
      given_high_(high),
      low_(low),
      high_(high),
      steps_(steps),
      report_at_(std::move(report_at)) {
  row_ = problem.unknowns();
  weights_ = like(row_);
  parameter_row_ = zero_like(row_);
  set_last_entry(parameter_row_, 1);
  clock_ = MPI_Wtime();
}

void Continuation::finish(std::string reason, bool converged) {
  reason_ = std::move(reason);
  converged_ = converged;
  finished_ = true;
}

Point Continuation::point(Trial&& trial, std::string event, double step) {
  Point p;
  p.parameter = parameter_of(trial.y);
  p.y = std::move(trial.y), p.tangent = std::move(trial.tangent);
  p.outcome = std::move(trial.outcome);
  p.event = std::move(event), p.step = step;
  p.wall = MPI_Wtime() - clock_;
  clock_ = MPI_Wtime();
  return p;
}

/// Events of the problem, and the fold: the tangent's parameter entry changes sign.
std::vector<TestFunction> Continuation::tests(Vec y, Vec tangent) {
  auto all = way_ ? std::vector<TestFunction>() : problem_.tests(y, tangent);
  all.push_back({"fold", last_entry(tangent), false, true});
  return all;
}

/// Of a trial or its tangent; what lies on a way may stand far from where it ends.
std::string Continuation::adrift(Trial const& trial) {
  if (way_) return {};
  const std::string stands = problem_.adrift(trial.y, trial.y);
  return stands.empty() ? problem_.adrift(trial.y, trial.tangent) : stands;
}

/// Newton on the system closed by row . y = value.
bool Continuation::find(Trial& trial, Vec row, double value, Effort effort) {
  newton_.system().close(row, value);
  trial.outcome = newton_.solve(trial.y, effort);
  if (!trial.outcome.converged) return false;
  if (const std::string why = problem_.impossible(trial.y); !why.empty()) {
    trial.outcome.reason = why;
    return false;
  }
  return true;
}

/// The same, then the unit tangent there, oriented along `tangent_row`.
bool Continuation::correct(Trial& trial, Vec row, double value, Vec tangent_row, Effort effort,
                           bool exactly) {
  if (!find(trial, row, value, effort)) return false;
  if (!trial.tangent) trial.tangent = zero_like(trial.y);
  if (tangent_row != row) newton_.system().close(tangent_row, 0);
  if (!newton_.tangent(trial.y, trial.tangent, exactly)) {
    trial.outcome.reason = "the linear solve for the tangent fails";
    return false;
  }
  if (!normalise(trial)) {
    trial.outcome.reason = "the tangent is not finite";
    return false;
  }
  if (adrift_ = adrift(trial); !adrift_.empty()) {
    trial.outcome.reason = adrift_;
    return false;
  }
  trial.tests = tests(trial.y, trial.tangent);
  return true;
}

/// Its tangent, to length 1 in its own metric.
bool Continuation::normalise(Trial& trial) {
  VecHandle weights = like(trial.y);
  problem_.metric(trial.y, weights);
  const double size = weighted_norm(weights, trial.tangent);
  if (!std::isfinite(size)) return false;
  check(VecScale(trial.tangent, 1 / size));
  return true;
}

/// Closing row W t at the anchor: row . (y - y_anchor) is the arclength.
void Continuation::prepare_row() {
  problem_.metric(anchor_.y, weights_);
  check(VecPointwiseMult(row_, weights_, anchor_.tangent));
  row_value_ = dot(row_, anchor_.y);
  anchor_tests_ = tests(anchor_.y, anchor_.tangent);
}

/// Between two points, in the metric of the anchor.
double Continuation::distance(Vec a, Vec b) const { return weighted_norm(weights_, moved(a, -1, b)); }

/// Angle between the anchor's tangent and the trial's [rad].
double Continuation::turn_of(Trial const& trial) const {
  return std::acos(std::clamp(dot(row_, trial.tangent), -1.0, 1.0));
}

/// What speaks against a corrected trial as the next point; nothing if it is one. An arc that turns by an
/// angle over a length L leaves its first tangent by half of L times the angle, and by all of it at a kink:
/// where the corrector came hard by a point farther aside, it is another branch's.
std::string Continuation::complaint(Trial& trial, double length, bool may_shorten) {
  const VecHandle along = moved(anchor_.y, length, anchor_.tangent);
  const double aside = distance(trial.y, along), angle = turn_of(trial);
  const bool hard = trial.outcome.newton - trial.outcome.refined > easy;
  if (!(aside <= length) || (may_shorten && hard && aside > (angle + unturned) * length)) {
    const std::string why = problem_.explain(trial.y, moved(trial.y, -1, along));
    return "the corrector lands on another branch" + (why.empty() ? "" : " (" + why + ")");
  }
  if (may_shorten && angle > steps_.max_angle) return "the branch turns too sharply";
  if (may_shorten && (trial.error = interpolation_error(trial, length)) > steps_.max_error)
    return "the branch bends more than a step resolves";
  if (may_shorten)
    return leads_back(trial) || fell_back(trial) ? "the corrector lands on another branch" : "";
  return oriented(trial, angle);
}

/// The corner at the end of the present piece, if that is no farther than a kink. Else `length` is shortened
/// to end just before it.
std::optional<Continuation::Trial> Continuation::turn_next_corner(double& length) {
  const auto end = facet(length);
  if (!end) return {};
  if (*end > kink_length) {
    length = before_end * *end;
    return {};
  }
  return turned(turn_corner(*end, std::min<double>(length, kink_length), true), length);
}

/// The same of pieces seen finely, which are too many to be walked one by one.
std::optional<Continuation::Trial> Continuation::turn_fine_corner(double& length) {
  double nearer = length;
  finely_ = true;
  auto behind = turn_next_corner(nearer);
  finely_ = false;
  if (behind) length = nearer;
  return behind;
}

std::optional<Continuation::Trial> Continuation::turned(std::optional<Trial> behind, double& length) {
  if (behind && just_touched() && round_facet(anchor_.y, behind->y)) behind.reset();
  turned_ = bool(behind);
  if (turned_) length = distance(behind->y, anchor_.y);
  return behind;
}

/// A trial at `length` from the anchor, or why there is none. Where corners lie about, pieces are walked one
/// by one; else a corner is looked for where no shorter step leads on.
std::optional<Continuation::Trial> Continuation::attempt(double& length, bool wary, Failure& failure) {
  const bool may_shorten = length > std::max<double>(kink_length, 16 * steps_.minimum);
  turned_ = finely_ = false;
  adrift_.clear();
  if (wary)
    if (auto behind = turn_next_corner(length)) return behind;
  VecHandle guess = predicted(length);
  if (may_shorten && !wary)
    if (auto end = attempt_end(guess, kink_length, length)) {
      failure.last = complaint(*end, length, true);
      return failure.last.empty() ? std::move(end) : std::nullopt;
    }
  Trial trial = at(std::move(guess));
  const bool shortened = length < often * anchor_.step;
  const Effort effort = may_shorten && !shortened && newton_.dear() ? Effort::brief
                        : wary && may_shorten                       ? Effort::plain
                                                                    : Effort::full;
  const bool solved = correct(trial, row_, row_value_ + length, row_, effort);
  failure.last = solved ? complaint(trial, length, may_shorten) : trial.outcome.reason;
  if (failure.last.empty()) return trial;
  if (!solved && failure.last.ends_with(')')) failure.explained = failure.last;
  if (may_shorten) return {};
  if (!wary)
    if (auto behind = turn_next_corner(length)) return behind;
  if (auto behind = turn_fine_corner(length)) return behind;
  return turned(turn_corner(length, length, false), length);  // one that no piece's number tells of
}

/// One accepted step from the anchor; halves the length on failure or when the branch bends too much. After a
/// failure in front of a corner, with none nearer by far, pieces are walked one by one until one is passed
/// without a turn. Where that ends, steps of all lengths are tried beyond the corners ahead, and then, of at
/// most 1000 unknowns, the other side of a facet that the branch touches.
std::optional<Continuation::Trial> Continuation::step(double& length, double& next_length) {
  Failure failure;
  double soft = INFINITY;  // an end of the present piece that is no corner
  wary_ = anchor_.wary;
  adrift_.clear();
  for (const bool beyond : {false, true}) {
    if (beyond && (!wary_ || !adrift_.empty())) break;
    double intended = anchor_.step;  // but for the ends of pieces
    for (length = intended; length >= steps_.minimum; length = intended) {
      auto trial = attempt(length, wary_ && !beyond, failure);
      if (trial && length < steps_.minimum && ++crawled_ > crawl) break;
      if (trial) {
        if (length >= steps_.minimum) crawled_ = 0;
        next_length = next_step(*trial, length, intended);
        return trial;
      }
      intended = length / 2;
      if (!adrift_.empty() && length < end_known) break;
      if (!wary_ && length < soft) wary_ = corner_within(length, soft);
    }
  }
  if (!adrift_.empty()) return finish(adrift_, false), std::nullopt;
  if (auto behind = behind_touched_facet(length)) {
    next_length = next_step(*behind, length, length);
    return behind;
  }
  if (failure.last.empty()) failure.last = "corners of the branch lie closer together than the smallest step";
  finish("step too small: " + (failure.explained.empty() ? failure.last : failure.explained), false);
  return {};
}

/// Behind an accepted trial at `length`, where `intended` was the step but for the end of a piece.
double Continuation::next_step(Trial const& trial, double length, double intended) {
  const double turn = turn_of(trial);
  const double by_angle = turned_ ? intended / length : 0.5 * steps_.max_angle / std::max(turn, 1e-12),
               by_error = std::pow(0.5 * steps_.max_error / std::max(trial.error, 1e-16), 0.25);
  if (turned_ && turn < seen_angle) wary_ = false;
  const double most = intended < anchor_.step ? 1.0 : wary_ || length < kink_length ? 4.0 : 2.0;
  return std::min(steps_.maximum, on_grid(std::clamp(length * std::min(by_angle, by_error), 0.3 * intended,
                                                     most * intended)));
}

/// Whether a place lies at an end of the range, or beyond.
bool Continuation::outside(Vec y) const {
  const double at = last_entry(y);
  return at <= problem_.parameter_entry(low_) || at >= problem_.parameter_entry(high_);
}

/// The branch has left its range at this end.
void Continuation::arrive(double reached) {
  const double goal = upwards_ ? high_ : low_;
  arrived_ = reached == goal;
  const std::string end = problem_.parameter_text(reached);
  if (arrived_)
    ending_ = "stop value reached";
  else if (reached != given_low_ && reached != given_high_)
    ending_ = "the branch comes back to " + problem_.parameter_text(began_) +
              ", where it began, without reaching " + problem_.parameter_text(goal) + " (followed on to " +
              end + ")";
  else
    ending_ = "the branch turns round and leaves its range at " + end + " instead of " +
              problem_.parameter_text(goal);
}

/// The points of a step in order: events inside it, then its end, unless that is beyond the range (true).
bool Continuation::fill_batch(Trial&& end, double length, double next_length) {
  std::string events;
  if (turned_)
    events = events_of_corner(end);
  else
    locate_events(end, length);
  ending_ = problem_.beyond(end.y);
  after_ = {.y = copy(end.y),
            .tangent = copy(end.tangent),
            .step = next_length,
            .index = 0,
            .wary = wary_,
            .smooth = foretold(end.y, length),
            .sign = end.sign};
  const bool gone = outside(end.y);
  if (!gone) emit(std::move(end), length, std::move(events));
  std::stable_sort(batch_.begin(), batch_.end(),
                   [](auto const& x, auto const& y) { return x.first < y.first; });
  return gone;
}

/// Ends with the stop value, if that is among them: whether it is.
bool Continuation::arrive_in_batch() {
  const auto stop = std::find_if(batch_.begin(), batch_.end(), [](auto const& x) {
    return x.second.event == "stop" || x.second.event == reported_stop;
  });
  if (stop == batch_.end()) return false;
  const double value = stop->second.parameter;
  if (stop->second.event == reported_stop) stop->second.event = "report";
  batch_.erase(stop + 1, batch_.end());
  arrive(std::abs(value - low_) < std::abs(value - high_) ? low_ : high_);
  return true;
}

/// The next step, after one of length `tried` at which the stop value was not to be had: a long step's
/// interpolation is too far from the branch; how long a corner's is does not depend on this.
void Continuation::make_batch(double tried) {
  batch_.clear();
  emitted_ = 0;
  double length, next_length;
  auto end = step(length, next_length);
  const auto remembered = std::tuple(meetings_, circles_, signs_, missed_);
  if (!end || been_here(*end)) return;
  const double stepped = MPI_Wtime() - clock_;  // belongs to the last of the batch, not to an event before it
  clock_ += stepped;
  const bool gone = fill_batch(std::move(*end), length, next_length);
  if (!arrive_in_batch() && gone) {
    if (length / 2 >= steps_.minimum && length <= shorter * tried) {
      clock_ -= stepped;
      trail_.forget();
      std::tie(meetings_, circles_, signs_, missed_) = remembered;
      anchor_.step = length / 2;
      return make_batch(length);
    }
    finish("the stop value is not reached: the corrector fails there", false);
  }
  if (!batch_.empty()) batch_.back().second.wall += stepped;
  after_.index = anchor_.index + int(batch_.size());
}

std::optional<Point> Continuation::next() {
  if (finished_) return {};
  if (emitted_ == int(batch_.size())) {
    if (!ending_.empty()) {
      finish(ending_, arrived_);
      return {};
    }
    if (!batch_.empty()) {
      before_ = std::move(anchor_);
      anchor_ = std::move(after_);
      prepare_row();
    }
    if (anchor_.index >= steps_.max_points) {
      finish("largest number of points", false);
      return {};
    }
    make_batch();
    if (batch_.empty()) return {};
  }
  Point out = std::move(batch_[emitted_].second);
  out.index = anchor_.index + emitted_++;
  return out;
}

}  // namespace fretwave::solve
