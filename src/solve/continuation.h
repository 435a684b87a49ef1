#pragma once
#include <deque>
#include <functional>
#include <optional>

#include "solve/newton.h"

namespace fretwave::solve {

/// How long the arclength steps are. The weighted norm of the unknowns is about 1, so a step of 0.1 is a
/// tenth of it.
struct StepControl {
  double initial = 0.05, minimum = 1e-9, maximum = 0.3;
  int target_newton = 4;   ///< longer steps below, shorter above
  double max_angle = 0.6;  ///< [rad] between neighbouring tangents; a step that turns more is halved
  int max_points = 5000;
};

struct Point {
  int index = 0;
  VecHandle y, tangent;
  double parameter = 0, step = 0;
  Outcome outcome;
  std::string event;  ///< "", start, stop, report, fold or the name of a test function
  double wall = 0;    ///< seconds since the point before
};

/// Pseudo-arclength continuation of a problem's branch: tangent predictor, SNES corrector on the bordered
/// system (Keller 1977).
class Continuation {
 public:
  Continuation(Problem&, std::string const& prefix, double low, double high, StepControl,
               std::vector<double> report_at);
  Continuation(Continuation const&) = delete;
  /// Newton at the parameter of y0, or the last state of an earlier run (anchor, tangent, ...). Collective.
  std::optional<Point> start(Vec y0, bool upwards);
  void restore(Vec y, Vec tangent, double step, int index, int emitted);
  /// The next point, or none with a reason. Collective.
  std::optional<Point> next();

  std::string const& reason() const { return reason_; }
  bool converged() const { return converged_; }
  Newton& newton() { return newton_; }

  /// What `restore` needs to go on bit for bit: the last anchor, and how many points of the step after it
  /// were handed out.
  struct Anchor {
    VecHandle y, tangent;
    double step = 0;
    int index = 0;
  };
  Anchor const& anchor() const { return anchor_; }
  int emitted() const { return emitted_; }

 private:
  struct Trial {
    VecHandle y, tangent;
    Outcome outcome;
    std::vector<TestFunction> tests;
  };
  bool correct(Trial&, Vec row, double value);
  void orient_past_kink(Trial& trial);
  std::optional<Trial> step(double& length, double& angle, double& next_length);
  double deviation(Vec y, double length) const;
  void make_batch();
  void locate_events(Trial const& end, double length);
  void locate(TestFunction const& before, size_t which, Trial const& end, double length);
  void reach(double value, std::string const& event, Trial const& end, double length);
  void interpolate(Trial const& end, double length, double at, Vec y) const;
  void emit(Trial&&, double at, std::string event);
  std::vector<TestFunction> tests(Vec y, Vec tangent);
  void prepare_row();
  Point point(Trial&&, std::string event, double step);
  void finish(std::string reason, bool converged);

  Problem& problem_;
  Newton newton_;
  double low_, high_;
  StepControl steps_;
  std::vector<double> report_at_;
  Anchor anchor_, after_;
  std::vector<TestFunction> anchor_tests_;
  VecHandle row_, weights_, parameter_row_;
  double row_value_ = 0;
  std::vector<std::pair<double, Point>> batch_;  ///< points of the present step by arclength
  int emitted_ = 0, index_ = 0;
  bool finished_ = false, stop_after_batch_ = false, converged_ = false;
  std::string reason_;
  double clock_ = 0;
};

}  // namespace fretwave::solve
