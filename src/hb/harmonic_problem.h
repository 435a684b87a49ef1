#pragma once
#include "hb/at_rest.h"
#include "hb/unfolding.h"
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
/// a), then, on the last rank, w . q = (1, 0) in the fundamental if there are three scalars (Laxalde et al.
/// 2008, eqs. 11 and 12), and the unfolding's.
class HarmonicProblem : public solve::Problem {
 public:
  HarmonicProblem(model::Model const&, Harmonics const&, int scalars, Row row, double reference_stiffness);
  MPI_Comm comm() const override { return model().comm(); }
  PetscInt local_equations() const override {
    return local_block_ + (last_rank() ? unfolding_.count() + scalars_ - 1 : 0);
  }
  /// Costs nothing at the point of linearisation.
  void residual(Vec y, Vec r) override;
  double rounding(Vec y) override;
  std::uint64_t piece(Vec y, bool finely = false) override;
  void product(Vec y, Vec dy, Vec dr) override;
  void transposed_product(Vec y, Vec dr, Vec dy) override;
  void pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) override;
  void values(Vec y, std::span<double> v) override;
  void metric(Vec y, Vec weights) override;
  double jacobian_entries() const override;
  std::string explain(Vec y, Vec dy) override;
  std::string adrift(Vec y, Vec dy) override;

  Harmonics const& harmonics() const { return residual_.harmonics(); }
  model::Model const& model() const { return residual_.model(); }
  /// What the fundamental is normalised by, or observed at.
  Row const& row() const { return row_; }
  int scalar_count() const { return scalars_; }
  double stiffness_scale() const { return stiffness_; }
  /// Structure and contact, whose laws all problems of the model share. What is read from them beside r is in
  /// diagnostics.h.
  Residual& terms() { return residual_; }
  AtRest& at_rest() { return at_rest_; }
  /// To be set before a solver is made.
  Unfolding& unfolding() { return unfolding_; }
  Unfolding const& unfolding() const { return unfolding_; }
  /// Physical coefficients Q as harmonic blocks. Collective.
  VecHandle coefficients(Vec y);
  /// (scalars z, fundamental coefficients of the row in q, tau): on every rank. Collective.
  std::vector<double> scalars(Vec y);
  /// What the scalars of y mean. Collective.
  ScaledMotion scaled(Vec y) { return motion(scalars(y)); }
  /// Column dr/dz_j at y, on the harmonic rows; until the next point of linearisation. Collective.
  Vec scalar_column(Vec y, int j);
  /// Linearised contact of this rank's pairs at y, in the unit of the rows, `stiffness_scale`. Collective.
  std::vector<PairTangents> pair_tangents(Vec y);
  /// The same problem, its loads and what stands at rest, on another set of harmonics; none where there is no
  /// other. Collective.
  virtual std::unique_ptr<HarmonicProblem> on(Harmonics const&) const { return nullptr; }

 protected:
  /// Of `on`.
  HarmonicProblem(HarmonicProblem const& same, Harmonics const&);
  virtual ScaledMotion motion(std::vector<double> const& z) const = 0;
  virtual double metric_weight(int /*scalar*/) const { return 1; }
  /// Force rows are measured in k a from now on; true if that changed them.
  bool measure_in(double k);
  /// Loads of another problem that stay as they are, its excitation included, and what stands at rest.
  void keep_loads(HarmonicProblem const& other) { at_rest_.keep(other.at_rest_, other.excitation_); }
  Vec excitation() { return excitation_; }  ///< P, zero unless a variant sets it
  VecHandle pack(Vec q, std::vector<double> const& z) const;

 private:
  bool normalised() const { return scalars_ > 1; }
  void border(std::vector<double> const& z, std::vector<double> const& along, double* r) const;
  /// The row's entries on this rank.
  std::span<std::pair<PetscInt, double> const> mine() const;
  bool linearised_at(Vec y) const;
  void linearise(Vec y);
  void unpack(Vec y);
  Vec column(int j);
  void add_stand_off(int j, Vec dR);
  double dload(int j) const { return motion_.dload.empty() ? 0 : motion_.dload[j]; }

  Residual residual_;
  AtRest at_rest_;
  Unfolding unfolding_;
  int scalars_;
  Row row_;
  PetscInt local_block_;
  double stiffness_;
  VecHandle q_, Q_, dQ_, R_, dR_, excitation_, last_;
  std::vector<VecHandle> columns_;  ///< of the scalars at `last_`, each once it has been asked for
  /// At the point of linearisation: the unit of the rows (0: there is none), the states of laws and of what
  /// stands at rest, unknowns of the unfolding.
  double linearised_in_ = 0;
  unsigned contact_version_ = 0, rest_version_ = 0;
  int unfolded_ = 0;
  std::vector<double> z_;
  ScaledMotion motion_;
};

/// Harmonic blocks with what follows them, on another set of harmonics: what is new is zero.
VecHandle embedded(model::Model const&, Harmonics const& from, Harmonics const& to, Vec x);

}  // namespace fretwave::hb
