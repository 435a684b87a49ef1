#pragma once
#include <petscsf.h>

#include "hb/aft.h"
#include "hb/dynamic_stiffness.h"

namespace fretwave::hb {

/// An entry of the contact map B: row `component` of a pair on this rank. Times e^{-i phase n theta} for
/// harmonic n where the dof is that of another sector.
struct Weight {
  int pair, component;
  PetscInt dof;
  double value;
  int phase = 0;
};

/// Linearised contact of this rank's pairs of one contact: dense dF/dU of each, row-major.
struct PairTangents {
  int pairs, components;
  std::vector<Weight> const& weights;  ///< pair by pair
  std::vector<double> D;               ///< pairs x (components m) x (components m)
};

/// Where the energy of a period goes [energy]: pi sum_n n Im(q_n^H p_n) of each force p.
struct EnergyBalance {
  double contact = 0;  ///< dissipated by contact
  double damping = 0;  ///< dissipated by C
  double modal = 0;    ///< released by the decay; equals the two in a free motion
  double stored = 0;   ///< pi sum_n n Re(q_n^H K q_n), to measure small ones with
};

/// One vector per contact, of this rank's pairs.
using PerContact = std::vector<std::vector<double>>;

/// R(Q, s) = Z(s) Q + B^T F(B Q, s B Q) (Laxalde et al. 2008, eq. 10) and its exact derivatives: one for all
/// variants, which differ in what s is. Vectors hold harmonic blocks of `block_size` per dof.
class Residual {
 public:
  Residual(model::Model const&, Harmonics const&);
  model::Model const& model() const { return model_; }
  Harmonics const& harmonics() const { return harmonics_; }
  VecHandle vector() const {
    return make_vector(model_.comm(), model_.local_dofs() * harmonics_.block_size());
  }

  /// R at (Q, e), which becomes the point of linearisation. Collective.
  void evaluate(Vec Q, Exponents const& e, Vec R);
  /// Products take dense stiffness without its rounding from now on, as residuals do.
  void multiply_exactly() { exactly_ = true; }
  /// Linearised friction has this share of its stuck stiffness, or of `most` [force/length] where that is
  /// less, more in the mean of the motion from now on: what slips all through the period holds no mean, and a
  /// body that nothing else holds makes the linear system singular.
  void hold_means(double share, double most) { held_share_ = share, stiffness_held_to_ = most; }
  /// dR for (dQ, de) at the last evaluated point; dQ or de may be null. Collective.
  void product(Vec dQ, Exponents const* de, Vec dR);

  /// dQ = (dR/dQ)^T dR at the last evaluated point. Collective.
  void transposed_product(Vec dR, Vec dQ);

  /// Entries of dR/dQ: global places on this rank, and values in the same order times `scale` at the last
  /// evaluated point.
  void pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols);
  double* values(double scale, double* v);

  /// Rounding to expect in R at the last evaluated point: of its linear terms, and of contact forces that
  /// stiff pairs take from small differences of displacements. Collective.
  double rounding() const;

  /// Of the last evaluated point. Collective.
  EnergyBalance energy();
  /// Of the vibration (Q, e) [energy], mean over a period: of M moving and K strained,
  /// sum_n>0 (|s_n|^2 q_n^H M q_n + q_n^H K q_n) / 4; what contact stores is left out. Collective.
  double mechanical_energy(Vec Q, Exponents const& e);

  /// Worn depths of the pairs [length], in the laws, which all residuals of the model share; empty for a
  /// contact that does not wear.
  void wear(PerContact const& depth);
  /// Widens all gaps by a distance [length] that is no wear, in the laws, which all residuals of the model
  /// share.
  void stand_off(double distance);
  /// dR for gaps that all grow by one unit of length, at the last evaluated point. Collective.
  void stand_off_product(Vec dR);
  /// dR for gaps that grow, at the last evaluated point. Collective.
  void gap_product(PerContact const& dgap, Vec dR);
  /// What wears the contacts in the motion (Q, e). Collective.
  std::vector<Wearing> wearing(Vec Q, Exponents const& e);

  DynamicStiffness const& stiffness() const { return stiffness_; }
  /// Linearised contact at the last evaluated point, one per contact. Collective.
  std::vector<PairTangents> pair_tangents();

  /// Contact of the motion (Q, e), summed over all ranks and contacts. Collective.
  ContactSummary summarise(Vec Q, Exponents const& e);
  /// Number of the smooth piece that the last evaluated point lies on, the same on every rank. Collective.
  std::uint64_t piece(bool finely) const;
  /// That of another point, after which none is evaluated. Collective.
  std::uint64_t piece_of(Vec Q, Exponents const& e, bool finely);
  /// Grows with every `settle` and `wear` of any problem that shares the laws; the same on every rank.
  unsigned contact_version() const;
  /// The laws take the mean relative displacement of Q as their rest state, reached from sliders that stand
  /// at zero, or as `from` says. Collective.
  void settle(Vec Q, PerContact const& from = {});
  /// Puts the sliders at rest there, tangents x pairs of each contact (Law::place).
  void place(PerContact const& sliders, unsigned owner);
  /// This rank's contact samples, one per contact. Collective.
  std::vector<ContactPeriod> periods(Vec Q, Exponents const& e);

 private:
  /// A contact's map to the sector `phase` places ahead.
  struct Map {
    int phase;
    Mat rows;                     ///< B_k
    MatHandle B;                  ///< B_k (x) I_m
    std::vector<complex> factor;  ///< e^{-i k n theta} per retained order
  };
  struct Group {
    model::Contact const* contact;
    std::vector<Map> maps;
    Aft aft;
    VecHandle U, F;
    std::vector<double> dV;
    struct Place {
      int pair, row, col;
      double value;
      int row_phase, col_phase;
    };
    std::vector<Place> places;
    std::vector<Weight> weights;
    Handle<PetscSF, PetscSFDestroy> dofs;  ///< of the weights, on their ranks
    /// Runs body(a, b) for any two weights of the same pair.
    template <class Body>
    void each_couple(Body body) const;
  };
  void expect_depths(PerContact const& depth) const;
  std::uint64_t of_all_ranks(std::uint64_t piece) const;
  void gaps_product(PerContact const& dgap, Vec dR);
  Map make_map(Mat B, int phase) const;
  void relative_motion(Group const&, Vec Q, Vec U) const;
  VecHandle relative_motion(Group const&, Vec Q) const;
  std::vector<VecHandle> relative_motions(Vec Q) const;  ///< of all contacts. Collective.
  void add_force(Group const&, Vec F, Vec R) const;
  void contact_product(Group&, Vec dQ, Exponents const* de, Vec dR);
  double holding(Group const&, int pair, int component) const;
  void transposed_contact_product(Group&, PairTangents const&, Vec dR, Vec dQ);
  void find_weights(Group&);
  std::vector<double> of_weights(Group const&, std::vector<double> const& of_dofs) const;
  void turn(int row_phase, int col_phase, double* block) const;
  std::vector<complex> factors(int phase) const;
  void contact_pattern(Group&, std::vector<PetscInt>& rows, std::vector<PetscInt>& cols);

  model::Model const& model_;
  Harmonics harmonics_;
  DynamicStiffness stiffness_;
  std::vector<Group> groups_;
  VecHandle Q_;  ///< copy of the last evaluated point (the callers' vectors are not ours to keep)
  Exponents e_;
  bool exactly_ = false;
  double held_share_ = 0, stiffness_held_to_ = 0;
  std::vector<PairTangents> tangents_;  ///< of transposed products, at the last evaluated point
};

}  // namespace fretwave::hb
