#pragma once
#include "wheel/mean_sector.h"

namespace fretwave::wheel {

/// The modes that move the contact most, of all waves and harmonics. Where families of modes are dense, a
/// little mistuning or contact that is not the same in all sectors couples their waves as much as these
/// differ, so that they are solved for together, all others having been eliminated:
///
///     S = z + Delta + N^-1 sum_j e^{-2 pi i j (d - d') / N} Lambda_d^H (X + E_j) Psi_d',
///
/// Delta what the wheel's terms have beside their means, E_j the eliminated contact of a sector.
class Families {
 public:
  struct Member {
    int harmonic, diameter, mode;
    bool operator==(Member const&) const = default;
  };
  /// shapes: U of the members one after the other. The same on every rank. Collective.
  Families(HarmonicProblem const&, MeanSector const&, std::vector<Member>, std::vector<complex> shapes);
  int size() const { return int(members_.size()); }
  std::vector<Member> const& members() const { return members_; }
  /// waves: S of each wave with X, members x members; coefficients of stiffness, damping and inertia by
  /// harmonic; Psi and Lambda^H: motion of a sector's rows by member and forces on members, rows innermost.
  /// `SingularBlock` if S is. Collective.
  void make(std::vector<complex> const& waves, std::vector<std::vector<complex>> const& coefficients,
            std::vector<complex> const& Psi, std::vector<complex> const& Lambda, WheelContact const&);
  /// S^-1 r, the same on every rank.
  std::vector<complex> solve(std::vector<complex> const& r) const;

 private:
  complex turn(int sector, size_t member) const;
  void set_deviation(int order, std::vector<complex> const& shapes);
  std::vector<complex> multiplied(Mat A, int member, complex const* shape) const;
  std::vector<complex> in_wave(std::vector<complex> const& x, size_t member) const;
  void add_contact(std::vector<complex> const& Psi, std::vector<complex> const& Lambda, WheelContact const&,
                   std::vector<double>& S) const;

  HarmonicProblem const& problem_;
  MeanSector const& mean_;
  int first_sector_, own_sectors_;
  std::vector<Member> members_;
  std::vector<std::vector<complex>> deviation_;  ///< by order, members x members, column-major
  std::vector<double> inverse_;                  ///< of S, (re, im) of a member side by side
};

}  // namespace fretwave::wheel
