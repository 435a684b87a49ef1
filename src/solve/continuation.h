#pragma once
#include <cmath>
#include <functional>
#include <optional>

#include "solve/hermite.h"
#include "solve/newton.h"
#include "solve/trail.h"

namespace fretwave::solve {

/// How long the arclength steps are. The weighted norm of the unknowns is about 1, so a step of 0.1 is a
/// tenth of it. Lengths follow from converged points alone (turn, error of interpolation), never from
/// iteration counts: the same branch has the same points on any number of ranks.
struct StepControl {
  double initial = 0.05, minimum = 1e-9, maximum = 0.3;
  double max_angle = 0.6;   ///< [rad] between neighbouring tangents; a step that turns more is halved
  double max_error = 5e-4;  ///< between the branch and the cubic through its points; likewise
  int max_points = 5000;
};

struct Point {
  int index = 0;
  VecHandle y, tangent;
  double parameter = 0, step = 0;
  Outcome outcome;
  std::string event;  ///< "", start, stop, report, fold or the name of a test function
  double wall = 0;    ///< seconds since the point before; of a step with events inside, without theirs
};

/// Pseudo-arclength continuation of a problem's branch: tangent predictor, SNES corrector on the bordered
/// system (Keller 1977), corners passed by where points lie, or by the orientation of Allgower & Georg
/// (2003).
class Continuation {
 public:
  /// What `restore` needs to go on: the last anchor, the one before it, and how many points of the step after
  /// it were handed out.
  struct Anchor {
    VecHandle y, tangent;
    double step = 0;
    int index = 0;
    bool wary = false;    ///< corners lie about: pieces are walked one by one
    bool smooth = false;  ///< the cubic through the points before foretold it
    int sign = 0;         ///< of det [J; tangent], where it was asked
  };

  Continuation(Problem&, std::string const& prefix, double low, double high, StepControl,
               std::vector<double> report_at);
  Continuation(Continuation const&) = delete;
  /// Newton at the parameter of y0. The branch is to reach `high` if it is to go upwards, else `low`.
  /// Collective.
  std::optional<Point> start(Vec y0, bool upwards);
  /// The last state of an earlier run; `before` may be empty. Returns what was the last point handed out.
  /// Collective.
  std::optional<Point> restore(Anchor anchor, Anchor before, int emitted, bool upwards, double began);
  /// The branch of the same problem in another discretisation, from a point (`event`) of its branch there:
  /// met at a right angle to that one's tangent, or at its parameter where that was asked for. No point where
  /// the corrector fails. Collective.
  std::optional<Point> take_over(Anchor from, std::string const& event, bool upwards, double began);
  /// Before the start, of a way whose end alone counts, where it is corrected anew: the problem's own test
  /// functions are left out, and nothing is polished.
  void follow_as_way() { way_ = true; }
  /// The next point, or none with a reason. Collective.
  std::optional<Point> next();

  std::string const& reason() const { return reason_; }
  bool converged() const { return converged_; }
  /// Points that were asked for or seen and could not be had, each with its reason.
  std::vector<std::string> const& missed() const { return missed_; }
  Newton& newton() { return newton_; }
  Anchor const& anchor() const { return anchor_; }
  Anchor const& before() const { return before_; }
  int emitted() const { return emitted_; }
  /// The point that was handed out is the last.
  bool ends() const { return emitted_ == int(batch_.size()) && !ending_.empty(); }
  /// Length of the step after the present one.
  double next_step() const { return after_.y ? after_.step : anchor_.step; }
  bool upwards() const { return upwards_; }
  double began() const { return began_; }

 private:
  struct Trial {
    VecHandle y, tangent;
    Outcome outcome;
    std::vector<TestFunction> tests;
    double error = 0;  ///< of the cubic from the anchor to it
    int sign = 0;      ///< as an anchor's
  };
  /// Why trials were none: the last one; one of a corrector that knows why.
  struct Failure {
    std::string last, explained;
  };
  /// A place inside the present step that Newton has been to.
  struct Place {
    double at, value;
  };
  /// Zero of the straight line between two places.
  static double secant(Place a, Place b) { return (a.at * b.value - b.at * a.value) / (b.value - a.value); }

  // The corrector (continuation.cpp)
  Trial at(VecHandle y) const { return {.y = std::move(y), .tangent = {}, .outcome = {}, .tests = {}}; }
  bool find(Trial&, Vec row, double value, Effort);
  /// With its tangent, good for a step along it or `exactly` what its test functions need.
  bool correct(Trial&, Vec row, double value, Vec tangent_row, Effort = Effort::full, bool exactly = false);
  bool normalise(Trial&);
  std::vector<TestFunction> tests(Vec y, Vec tangent);
  std::string adrift(Trial const&);
  void open_the_range();
  void prepare_row();
  double turn_of(Trial const&) const;
  double distance(Vec a, Vec b) const;
  std::string complaint(Trial&, double length, bool may_shorten);
  std::optional<Trial> turn_next_corner(double& length);
  std::optional<Trial> turn_fine_corner(double& length);
  std::optional<Trial> turned(std::optional<Trial> behind, double& length);
  std::optional<Trial> attempt(double& length, bool wary, Failure&);
  double next_step(Trial const&, double length, double intended);
  std::optional<Trial> step(double& length, double& next_length);
  void finish(std::string reason, bool converged);
  Point point(Trial&&, std::string event, double step);
  bool fill_batch(Trial&& end, double length, double next_length);
  bool arrive_in_batch();
  void make_batch(double tried = INFINITY);
  bool outside(Vec y) const;
  void arrive(double reached);

  // What cubics through its points foretell (interpolation.cpp)
  VecHandle by_cubic(double length);
  VecHandle predicted(double length);
  bool foretold(Vec y, double length);
  double untold(Hermite const& across, Vec off, double last, double now);
  double interpolation_error(Trial const&, double length);
  double error_in_the_middle(Trial const&, double length);

  // Whether it comes back to where it has been (revisit.cpp)
  bool been_here(Trial const&);
  bool fell_back(Trial const&);
  bool walk(Trial&, Vec row, double to);
  bool passes(Trial const&, Trail::Meeting const&);

  // Corners of the branch (corner.cpp)
  static bool small(Vec y);
  int determinant(Vec y, Vec row);
  int anchor_sign();
  double along_facet(Vec y, Vec tangent, double least = 0);
  int orientation(Vec y, Vec tangent);
  int orientation(Vec y, Vec tangent, double cosine);
  bool beyond_corner(Trial const&) const;
  bool straight_there(Trial const&, int sign) const;
  bool leads_back(Trial&);
  std::string oriented(Trial&, double angle);
  std::uint64_t piece(Vec y) { return problem_.piece(y, finely_); }
  bool on_piece(std::uint64_t here, double at);
  bool corner_within(double reach, double& soft);
  double piece_end(std::uint64_t here, double reach, double share);
  std::optional<double> facet(double reach);
  bool fits(Vec y);
  double within_piece(Vec y, Vec tangent, double reach);
  int into_piece(Vec y, Vec tangent, double reach);
  std::optional<Trial> turn_corner(double beyond, double reach, bool seen);
  std::optional<VecHandle> tangent_at(Vec y);
  std::optional<Trial> along_piece(Vec y, Vec tangent, double reach, double aside, double least);

  // Where it touches a facet (round_facet.cpp)
  bool round_facet(Vec a, Vec b);
  bool on_other_sheet(Trial const&, Trial const&);
  VecHandle stiffest();
  bool just_touched();
  std::optional<Trial> turn_round_facet(Vec across, double length);
  std::optional<Trial> behind_touched_facet(double& length);

  // What lies inside a step (events.cpp)
  bool correct_inside(Trial&, double at, double length);
  void locate_events(Trial const& end, double length);
  std::string events_of_corner(Trial const& end);
  void locate(size_t which, std::vector<Place> const& scan, Hermite const&, double length);
  std::optional<Trial> root(size_t which, Place a, Place b, Hermite const&, double length, double& found);
  class Bracket;
  static constexpr double least_along = 0.2;  ///< of a tangent along the step, to be taken by arclength
  double zero_on(Hermite const&, size_t which, Place a, Place b);
  double foretold_zero(Hermite const&, size_t which, Bracket const&);
  double beyond(Hermite const& known, size_t which, Place before, Place last, double apart);
  std::optional<Trial> on(Hermite const&, double at);
  Hermite with(Hermite const&, double at, Vec y, Vec tangent) const;
  void reach(double value, std::string const& event, Place a, Place b, Hermite const&, double length);
  double passing(std::function<VecHandle(double)> const& guess, double target, Place from, double to);
  std::optional<Trial> attempt_end(Vec guess, double shortest, double& length);
  void emit_end(Trial const& end, double target, double length, std::string const& event);
  void polish(Trial&, double target);
  std::optional<Trial> reach_along(double target, Place a, Place b, Hermite const&);
  std::optional<Trial> reach_by_steps(double target, Place a, Place b, Hermite const&, std::string& why);
  std::optional<Trial> at_value(double target, Place a, Place b, Hermite const&, double length,
                                std::string& why);
  static constexpr double off_the_curve = 0.5;  ///< of a step: a solution farther from it is another branch
  static constexpr double value_error = 1e-9;   ///< relative, of a parameter's value reached along the branch
  static constexpr char elsewhere[] = "Newton goes to another branch there";
  static constexpr char reported_stop[] = "report stop";  ///< while a step is looked at
  std::string stop_event(double end) const;
  void locate_values(Trial const& end, Hermite const&, double length);
  void emit(Trial&&, double at, std::string event);
  void miss(std::string const& what, std::string const& why);
  double parameter_of(Vec y) const { return problem_.parameter_value(last_entry(y)); }

  Problem& problem_;
  Newton newton_;
  double given_low_, given_high_, low_, high_;  ///< the range, and with the room at its first end
  StepControl steps_;
  std::vector<double> report_at_;
  Anchor anchor_, before_, after_;
  std::vector<TestFunction> anchor_tests_;
  std::vector<int> signs_;  ///< of the test functions where they last had one
  VecHandle row_, weights_, parameter_row_;
  double row_value_ = 0, began_ = 0;
  std::vector<std::pair<double, Point>> batch_;  ///< points of the present step by arclength
  std::vector<double> folds_;                    ///< arclengths of the folds in it
  std::vector<std::string> missed_;
  Trail trail_;
  int emitted_ = 0, meetings_ = 0, circles_ = 0, crawled_ = 0;
  bool way_ = false, upwards_ = true, taken_over_ = false, turned_ = false, finely_ = false, wary_ = false,
       finished_ = false, converged_ = false;
  std::string ending_;  ///< reason to stop once the batch is handed out
  bool arrived_ = false;
  std::string reason_;
  std::string adrift_;  ///< why a corrected trial of the present attempt was no solution
  double clock_ = 0;
};

}  // namespace fretwave::solve
