#pragma once
#include "contact/law.h"
#include "hb/continuous_force.h"

namespace fretwave::hb {

/// Contact quality of one motion: energies for the truncated share, and what the law diagnoses.
struct ContactSummary {
  double stick = 0, slip = 0, open = 0;  ///< pairs, each by its shares of the period
  double truncated = 0, total = 0;  ///< of the varying force: energy outside the retained orders, and in all
  double aliased = 0,
         retained = 0;  ///< squared change of the coefficients on doubled samples, and their square (n > 0)
  double work = 0;      ///< dissipated energy per period [energy]
  double unclosed = 0;  ///< largest |w(T) - w(0)| of a slider [length]
  double path = 0;      ///< longest slip path of a pair in the period [length], to measure it with
};

/// Time samples of a period: samples x components x pairs.
struct ContactPeriod {
  std::vector<double> u, v, f;
  std::vector<contact::Status> status;  ///< samples x pairs, as is the gap [length]
  std::vector<double> gap;
  std::vector<double> work, shares;  ///< per pair [energy]; of the period in stick, slip and open, 3 x pairs
  double unclosed = 0;               ///< as in ContactSummary
};

/// What wears a contact over a period, per pair.
struct Wearing {
  std::vector<double> archard;     ///< integral of N |d slider| [energy]; zero for a law that does not wear
  std::vector<double> load;        ///< mean normal force [force]
  std::vector<double> slip, open;  ///< shares of the period
};

/// Alternating frequency-time (Laxalde et al. 2008, section 2.2) for the contact pairs of this rank: harmonic
/// blocks of relative displacement in, of force out. Blocks are (pairs x components) x block size. Never
/// communicates. Laws that are integrated in continuous time are not sampled: ContinuousForce has their
/// force; samples are for those who look.
class Aft {
 public:
  Aft(Harmonics const&, std::shared_ptr<contact::Law const>);
  int columns() const { return columns_; }
  /// Force of rounding in a displacement, per length of it: a stiffness, where it is known by the share of
  /// the period in which the last force follows it (stick, contact).
  double stiffness(int pair, int component) const {
    return continuous_ ? continuous_->mean_stiffness(pair, component)
                       : law_->stuck_stiffness(component, pair);
  }

  /// F(U, s) and its linearisation for what follows.
  void force(double const* U, Exponents const&, double* F);
  /// dF for dU and dV, the harmonic blocks of the velocity's perturbation.
  void product(double const* dU, double const* dV, double* dF);
  /// dF for gaps that grow by dgap (pairs) [length]: N = kn (u_n - gap) sees them as normal displacements
  /// that fall.
  void gap_product(double const* dgap, double* dF);
  /// Dense dF/dU of each pair, pairs x (components m) x (components m), with the velocity's share through s.
  void blocks(Exponents const&, double* D);

  /// Number of the smooth piece that the last force lies on.
  std::uint64_t piece(bool finely) const;
  /// That of U, in less time where it needs no force.
  std::uint64_t piece_of(double const* U, Exponents const&, bool finely);

  ContactSummary summarise(double const* U, Exponents const&);
  ContactPeriod period(double const* U, Exponents const&) const;
  Wearing wearing(double const* U, Exponents const&) const;

 private:
  contact::Motion motion(double omega) const;
  contact::Motion whole(ContactPeriod const&, Exponents const&) const;
  double angular_frequency(Exponents const&) const;
  /// A motion beside the last one: its samples without the law's word, the force's harmonics, its pieces.
  struct Found {
    ContactPeriod samples;
    std::vector<double> F;
    std::unique_ptr<ContinuousForce> exact;  ///< null where sampled
  };
  Found find(double const* U, Exponents const&) const;
  contact::Diagnosis diagnosis(Found const&, Exponents const&, bool archard,
                               std::vector<double> gap = {}) const;
  std::vector<double> on_doubled_samples(double const* U, Exponents const&, std::vector<double> F);
  /// For who reads a period of what is not sampled; made when first asked for, as the tables take longer.
  FourierTransform const& whole_transform() const;
  void mirror(std::vector<double>& samples, double sign, int columns) const;
  void toeplitz_hankel(std::vector<double> const& tangent, std::vector<double>& T) const;

  Harmonics harmonics_;
  std::shared_ptr<contact::Law const> law_;
  int pairs_, columns_, law_samples_;  ///< law_samples: half a period when half-wave symmetric
  std::unique_ptr<ContinuousForce> continuous_;
  contact::Record record_;  ///< of the last force
  FourierTransform transform_, tangent_transform_;
  std::vector<double> velocity_, u_, v_, f_;
  mutable std::shared_ptr<FourierTransform> whole_transform_;
  std::shared_ptr<Aft> doubled_;  ///< on twice the samples
};

}  // namespace fretwave::hb
