#pragma once
#include <petscts.h>

#include <complex>
#include <exception>
#include <string>

#include "model/model.h"

/// Direct time integration of the unreduced equations, for verification.
namespace fretwave::transient {

/// One line of the excitation: Re(P e^{i n w t}) as cosine and sine parts, p(t) = P_c cos(n w t) + P_s sin(n
/// w t).
struct Excitation {
  int order;
  VecHandle cosine, sine;
};

struct History {
  std::vector<double> t;
  std::vector<std::vector<double>> x, v;  ///< this rank's dofs at each time
  int steps = 0;
  bool finished = true;
  std::string reason;
};

/// M x'' + C x' + K x + B^T f = p(t) as a first-order system for PETSc TS (prefix transient_; default:
/// Runge-Kutta 5(4) of Dormand and Prince with step control). Only for laws that depend on the present state
/// alone.
class Transient {
 public:
  Transient(model::Model const&, std::vector<Excitation> excitation, double omega, std::string const& prefix);
  Transient(Transient const&) = delete;
  /// From (x0, v0) to t_end, sampled every dt_out by the method's own interpolation; stops early when |x|
  /// exceeds `limit`. Collective.
  History run(Vec x0, Vec v0, double t_end, double dt_out, double tolerance, double limit);

 private:
  static PetscErrorCode right_side(TS, PetscReal, Vec, Vec, void*);
  static PetscErrorCode after_step(TS);
  void rate(double t, Vec state, Vec rate);
  void contact_force(model::Contact const&, Vec force);
  void record(TS);
  void sample(double t, Vec state);

  model::Model const& model_;
  std::vector<Excitation> excitation_;
  double omega_;
  std::string prefix_;
  MatHandle K_, C_;
  KspHandle mass_;
  VecHandle x_, v_, force_, acceleration_, interpolated_;
  std::exception_ptr exception_;
  History history_;
  double interval_ = 0, end_ = 0, limit_ = 0;
};

}  // namespace fretwave::transient
