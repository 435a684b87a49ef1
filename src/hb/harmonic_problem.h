#pragma once
#include <optional>

#include "hb/residual.h"
#include "solve/problem.h"

namespace fretwave::hb {

/// Gaps of this many amplitudes are out of a motion's reach, also in resonance.
constexpr double out_of_reach = 1000;
/// Of gaps t amplitudes wider: a step is a share of them while they are wide.
inline double gap_weight(double t) { return 1 / std::max(1.0, t * t); }
std::string gap_text(double distance);

/// What a variant's scalar unknowns z mean: motion Q = a q, exponents s_n, and their derivatives by each
/// scalar.
struct ScaledMotion {
  double amplitude = 1;                  ///< a
  Exponents exponents;                   ///< s_n
  std::vector<double> dlog_amplitude;    ///< d log a / dz_j
  std::vector<Exponents> dexponents;     ///< d s_n / dz_j
  double load = 1;                       ///< factor on the excitation P
  std::vector<double> dload = {};        ///< d load / dz_j; empty if constant
  double stand_off = 0, dstand_off = 0;  ///< by which all gaps are widened [length], and by the last scalar
};

/// A row of displacements w . x: (dof, weight), dofs ascending, the whole row on every rank.
using Row = std::vector<std::pair<PetscInt, double>>;

/// y = (q, tau, z): scaled harmonic blocks q = (Q - Q_static) / a, then on the last rank the unfolding tau,
/// if any, and the scalars z; z's last entry is the continuation parameter. Rows (R(a q, s(z)) - P) / (k_ref
/// a), then, on the last rank, w . q = (1, 0) in the fundamental if there are three scalars (DESIGN fact 4),
/// and the unfolding's.
class HarmonicProblem : public solve::Problem {
 public:
  HarmonicProblem(model::Model const&, Harmonics const&, int scalars, Row row, double reference_stiffness);
  MPI_Comm comm() const override { return residual_.model().comm(); }
  PetscInt local_equations() const override {
    return local_block_ + (last_rank() ? unfoldings() + scalars_ - 1 : 0);
  }
  void residual(Vec y, Vec r) override;
  /// The same, which costs nothing at the point of linearisation. Collective.
  VecHandle residual_at(Vec y);
  double rounding(Vec y) override;
  std::uint64_t piece(Vec y) override;
  void product(Vec y, Vec dy, Vec dr) override;
  void pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) override;
  void values(Vec y, std::span<double> v) override;
  void metric(Vec y, Vec weights) override;

  Harmonics const& harmonics() const { return residual_.harmonics(); }
  model::Model const& model() const { return residual_.model(); }
  /// What the fundamental is normalised by, or observed at.
  Row const& row() const { return row_; }
  /// Dynamics about a static state x under the static load P: Q = (x, 0, ...) + a q. The mean is retained
  /// then; what was set before is replaced. Collective.
  void preload(Vec x, Vec P);
  /// Unfolds the double mode of a tuned wheel (DESIGN fact 6): a fundamental force along M phi with two
  /// unknown amplitudes tau, and two rows that keep the fundamental's component phi^H M q_1 at zero; phi = re
  /// + i im is the linear mode that the motion shall not turn into. Before a solver is made. Collective.
  void unfold(Vec re, Vec im);
  /// tau, as shares of the inertia force k_ref a of a unit motion; none if not unfolded. Collective.
  std::vector<double> unfolding(Vec y);
  /// M phi on the fundamental, real and imaginary part, of unit length; none if not unfolded.
  std::vector<VecHandle> const& unfolding_vectors() const { return unfold_; }
  /// Physical coefficients Q as harmonic blocks. Collective.
  VecHandle coefficients(Vec y);
  /// (scalars z, fundamental coefficients of the row in q, tau): on every rank. Collective.
  std::vector<double> scalars(Vec y);
  /// Contact of the motion at y, summed over ranks. Collective.
  ContactSummary summarise(Vec y);
  int scalar_count() const { return scalars_; }
  double stiffness_scale() const { return stiffness_; }
  /// Residual::multiply_exactly
  void multiply_exactly() { residual_.multiply_exactly(); }
  DynamicStiffness const& stiffness() const { return residual_.stiffness(); }
  /// Column dr/dz_j at y, on the harmonic rows; until the next point of linearisation. Collective.
  Vec scalar_column(Vec y, int j);
  /// Linearised contact of this rank's pairs at y, in the unit of the rows, `stiffness_scale`. Collective.
  std::vector<PairTangents> pair_tangents(Vec y);
  double jacobian_entries() const override;
  std::string explain(Vec y, Vec dy) override;
  /// The fixed loads of another problem, excitation included; its static state is the rest. Collective.
  void keep_loads(HarmonicProblem const& other);
  /// The laws start their march from the static state at y (Residual::settle). Collective.
  void settle(Vec y, PerContact const& from = {}) { residual_.settle(coefficients(y), from); }
  /// Sliders at rest of this problem, whatever others of the model do with the laws' (Residual::place).
  void stand(PerContact sliders);
  std::vector<ContactPeriod> contact_periods(Vec y);
  /// Worn depths of this rank's pairs [length], contact by contact, from now on (Residual::wear).
  void wear(PerContact const& depth);
  /// dr for gaps that grow by dgap [length], the derivative of r by worn depths. Collective.
  VecHandle gap_product(Vec y, PerContact const& dgap);
  std::vector<Wearing> wearing(Vec y) { return residual_.wearing(coefficients(y), exponents(y)); }
  EnergyBalance energy(Vec y);
  Exponents exponents(Vec y) { return motion(scalars(y)).exponents; }
  /// The same problem, its loads and what stands at rest, on another set of harmonics; none where there is no
  /// other. Collective.
  virtual std::unique_ptr<HarmonicProblem> on(Harmonics const&) const { return nullptr; }
  /// Unknowns or equations of this problem as those of the same one on another set: what is new is zero.
  VecHandle on(HarmonicProblem const& other, Vec x) const;

 protected:
  /// Of `on`.
  HarmonicProblem(HarmonicProblem const& same, Harmonics const&);
  virtual ScaledMotion motion(std::vector<double> const& z) const = 0;
  virtual double metric_weight(int /*scalar*/) const { return 1; }
  /// Force rows are measured in k a from now on; true if that changed them.
  bool measure_in(double k);
  Vec excitation() { return excitation_; }  ///< P, zero unless a variant sets it
  VecHandle pack(Vec q, std::vector<double> const& z) const;

 private:
  bool normalised() const { return scalars_ > 1; }
  int unfoldings() const { return int(unfold_.size()); }
  std::vector<double> components(Vec q) const;
  void border(std::vector<double> const& z, std::vector<double> const& along, double* r) const;
  /// The row's entries on this rank.
  std::span<std::pair<PetscInt, double> const> mine() const;
  void linearise(Vec y);
  void put_residual(Vec r);
  void unpack(Vec y);
  Vec column(int j);
  void set_mean(Vec per_dof, Vec blocks);
  void add_stand_off(int j, Vec dR);
  double dload(int j) const { return motion_.dload.empty() ? 0 : motion_.dload[j]; }

  Residual residual_;
  int scalars_;
  Row row_;
  PetscInt local_block_;
  double stiffness_;
  VecHandle q_, Q_, dQ_, R_, dR_, excitation_, static_, static_load_, last_;
  std::vector<VecHandle> columns_;  ///< of the scalars at `last_`, each once it has been asked for
  std::vector<VecHandle> unfold_;
  std::optional<PerContact> sliders_;
  unsigned owner_ = 0;  ///< of the sliders, as the laws know it
  bool linearised_ = false;
  unsigned contact_version_ = 0;  ///< of the laws at the point of linearisation
  std::vector<double> z_;
  ScaledMotion motion_;
};

}  // namespace fretwave::hb
