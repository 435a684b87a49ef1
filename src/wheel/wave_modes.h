#pragma once
#include <memory>
#include <optional>

#include "precondition/contact_gmres.h"
#include "wheel/families.h"
#include "wheel/wave_basis.h"
#include "wheel/wave_blocks.h"

namespace fretwave::wheel {

/// Modes of the tuned wheel with all its pairs stuck, one basis a nodal diameter,
///
///     U^H (K_d + B^H k B) U = 1,  U^H M_d U = Theta,  of U^H C_d U the diagonal,
///
/// shared by all harmonics that move in it; that of N - d is its conjugate. There a wave's block z is
/// diagonal (Laxalde et al. 2008, eq. 7), at every point, but for what its contact lacks of the stuck one on
/// average, T = t - k, which has as many rows as the contact of a sector:
///
///     A^-1 = U (Z - Z Phi^H X Phi Z) U^H,  Z = z^-1,  Phi = B U,  X = (1 + T G)^-1 T,  G = Phi Z Phi^H.
///
/// Of large sectors the lowest modes serve, beside what is static (`WaveBasis`): for all modes
///
///     U Z U^H  stands  U (Z - 1/c) U^H + K_s^-1 / c,  c the coefficient of the stiffness.
///
/// About motions that are no travelling wave the modes near the fundamental are kept out of Z and solved for
/// together (`Families`).
class WaveModes : public WaveBlocks {
 public:
  /// Null where there are none: terms that are not symmetric, a free motion with all pairs stuck, springs
  /// without an end or far stiffer than the structure, damping between modes at the exponent `highest`.
  /// Collective.
  static std::unique_ptr<WaveModes> of(HarmonicProblem&, MeanSector const&,
                                       std::vector<Circulant<SparseBlock>> const& terms, WheelContact&,
                                       std::vector<Wave> const&, double highest);
  void make(Point const&) override;
  void couple(std::vector<complex> const& local) override;
  std::vector<complex> solve(std::vector<complex> const& x, Forces const&) const override;
  double flops() const override;
  double applied_flops() const override;
  double megabytes() const override;
  std::string describe() const override;

 private:
  struct Diameter {
    int d;
    std::vector<size_t> waves;  ///< that move in d or N - d, whose numbers are taken conjugate
    std::shared_ptr<WaveBasis const> basis;
  };
  /// In single precision what an application reads.
  struct OfWave {
    std::vector<complex> z, Z;               ///< Z less what is static
    complex softness;                        ///< 1 / c of what is static
    std::vector<scomplex> X, motion, force;  ///< X, 1 - G X, 1 - X G
    std::vector<scomplex> between;           ///< compliance less that of a single sector
    std::vector<int> family;                 ///< its modes near the fundamental
    std::vector<complex> Psi, Lambda;        ///< of these, rows innermost
  };
  WaveModes(HarmonicProblem&, MeanSector const&, WheelContact&, std::vector<Wave> const&);
  std::vector<complex> coefficients(Exponents const&, int harmonic) const;
  void set(Diameter const&, size_t wave, Exponents const&);
  void find_family(Exponents const&);
  void make_families();
  /// Forces on modes g by wave and motion of the rows b; of the families' modes where they have moved; and
  /// K_s^-1 x by wave, none where no force is worth it.
  struct State {
    std::vector<std::vector<complex>> g;
    std::vector<complex> b, families;
    std::vector<std::vector<complex>> moved;
  };
  /// Forces on rows, and the families' motion.
  struct Reply {
    std::vector<complex> f, eta;
  };
  State relaxed(std::vector<complex> const& x) const;
  void move_statically(State&, std::vector<complex> const& x) const;
  std::vector<complex> modal(size_t wave, State const&, std::vector<complex> const& h,
                             std::vector<complex>::const_iterator& families) const;
  std::vector<complex> motions(State const&) const;
  std::vector<complex> held(size_t wave, State const&, std::vector<complex> const& f) const;
  std::vector<complex> dofs(State const&, std::vector<complex> const& f) const;
  std::vector<complex> forces_on_families(State const&) const;
  std::vector<complex> family(std::vector<complex> r, std::vector<complex> const& f) const;
  Reply reply(std::vector<complex> u, std::vector<complex> const& r, Forces const& E) const;
  std::vector<complex> between(std::vector<complex> const& f) const;
  std::vector<complex> coupled(std::vector<complex> u, std::vector<complex> const& r, Forces const& E) const;
  void move_families(State&, std::vector<complex> const& eta) const;
  /// A x of a wave's rows.
  std::vector<scomplex> times(std::vector<scomplex> const& A, complex const* x) const;
  Diameter const& of_diameter(size_t wave) const { return diameters_[diameter_of_[wave]]; }
  /// An iteration of the sectors' coupling reads less than one outside.
  bool inside_pays() const { return rows_ > 0 && 4 * rows_ * rows_ < n_ * n_; }
  int modes(Diameter const& of_d) const { return int(of_d.basis->theta.size()); }
  bool mirrored(size_t wave) const { return waves_[wave].diameter > mean_.sectors() / 2; }
  complex turned(size_t wave, complex a) const { return mirrored(wave) ? std::conj(a) : a; }

  HarmonicProblem& problem_;
  MeanSector const& mean_;
  WheelContact& contact_;
  std::vector<Wave> waves_;
  int n_, rows_;
  std::vector<double> stuck_;
  std::vector<Diameter> diameters_;
  std::vector<size_t> diameter_of_;  ///< by wave
  std::vector<OfWave> of_wave_;
  Exponents beside_;
  complex chosen_at_ = 0;    ///< the fundamental's exponent where the families were chosen
  size_t first_member_ = 0;  ///< of this rank's among the families'
  std::optional<Families> families_;
  bool apart_ = false;  ///< the families' modes are kept out
};

}  // namespace fretwave::wheel
