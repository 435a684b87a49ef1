#pragma once
#include <petscts.h>

#include <complex>
#include <string>

#include "guard.h"
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
  bool implicit = false;  ///< by implicit steps, since explicit ones would have been too many
  bool finished = true;   ///< reached the end
  std::string reason;     ///< "end", "limit" (of the motion), "steps" (too many), or what stopped the method
};

/// M x'' + C x' + K x + B^T f = p(t) as a first-order system for PETSc TS (prefix transient_), with step
/// control: Runge-Kutta 5(4) of Dormand and Prince; where the contact is so stiff that its steps would never
/// end, linearly implicit steps (Rosenbrock-W of order 3 with the laws' tangents: no Newton iteration that a
/// kink could stop). Only for laws that depend on the present state alone; InputError for others.
class Transient {
 public:
  Transient(model::Model const&, std::vector<Excitation> excitation, double omega, std::string const& prefix);
  Transient(Transient const&) = delete;
  /// From (x0, v0) to t_end, sampled every dt_out by the method's own interpolation; stops early when |x|
  /// exceeds `limit`, with that state, or when more than `most_steps` steps would be needed. Collective.
  History run(Vec x0, Vec v0, double t_end, double dt_out, double tolerance, double limit, double most_steps);
  /// A contact's components of its pairs at a time, pairs innermost, and its tangents by displacements.
  struct Seen {
    std::vector<double> u, v, f, tangent;
  };

 private:
  /// A contact's rows of B on this rank, its law's tangents at the present state, and room for that: a step
  /// of a small model takes no longer than allocations.
  struct Tangents {
    std::vector<std::vector<std::pair<PetscInt, double>>> rows;
    contact::Record record;
    VecHandle u, v, f;                                  ///< as rows of B: pair by pair
    std::vector<double> displacement, velocity, force;  ///< as laws have it: pairs innermost
  };
  /// Displacement and velocity by which errors are weighed.
  struct Sizes {
    double x, v;
  };
  static PetscErrorCode right_side(TS, PetscReal, Vec, Vec, void*);
  static PetscErrorCode residual(TS, PetscReal, Vec, Vec, Vec, void*);
  static PetscErrorCode jacobian(TS, PetscReal, Vec, Vec, PetscReal, Mat, Mat, void*);
  static PetscErrorCode after_step(TS);
  static PetscErrorCode expect_sound(TS, PetscReal, Vec state, PetscBool* accept);
  History integrate(Vec x0, Vec v0, double tolerance, bool implicit);
  Sizes sizes(Vec state);
  double rate(Vec shape);
  void set_up(TS, Vec state, double tolerance, bool implicit);
  void conclude(TS);
  void use_explicit(TS);
  void use_implicit(TS);
  void resolve_sticking(double tolerance, double size, Vec allowed);
  void forces(double t, Vec state, bool tangents);
  void place(Vec state);
  void meet(model::Contact const&, Tangents&, bool tangents);
  void contact_force(model::Contact const&, Tangents&, Vec force, bool tangents);
  void solve_mass(Vec force, Vec acceleration);
  void prepare_jacobian();
  void assemble(double shift, Mat A);
  void assemble_contact(size_t number, Mat A);
  void add_tangent(size_t number, Vec x, Vec out);
  std::vector<Seen> see(Vec state);
  bool passes_kinks(TS, double t, Vec end);
  double largest(Vec state) const;
  void record(TS);
  void watch(TS);
  void sample(double t, Vec state);
  /// Places of a dof's displacement and velocity in the state, which holds [x, v] rank by rank.
  std::pair<PetscInt, PetscInt> places(PetscInt dof) const;

  model::Model const& model_;
  std::vector<Excitation> excitation_;
  double omega_;
  std::string prefix_;
  MatHandle M_, K_, C_, jacobian_;
  KspHandle mass_;
  std::vector<Tangents> tangents_;
  bool stiff_ = false, exhausted_ = false;
  VecHandle x_, v_, force_, acceleration_, interpolated_;
  std::vector<Seen> begun_;  ///< contacts at a step's begin
  Guard guard_;
  History history_;
  double interval_ = 0, end_ = 0, limit_ = 0, most_steps_ = 0;
  double allowed_ = 0;  ///< error of displacements
};

}  // namespace fretwave::transient
