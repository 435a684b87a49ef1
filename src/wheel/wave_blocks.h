#pragma once
#include <functional>

#include "wheel/mean_sector.h"

namespace fretwave::wheel {

using scomplex = std::complex<float>;

/// A^-1 of the tuned wheel for the waves of this rank, harmonic by harmonic: structure and mean tangents of
/// the contact over the stiffness that force rows are measured in.
class WaveBlocks {
 public:
  /// f = E u of the contact, own waves x contact rows. Collective.
  using Forces = std::function<std::vector<complex>(std::vector<complex> const& u)>;
  struct Point {
    Exponents exponents;
    std::vector<char> moving;  ///< diameters that the fundamental moves in, if its motion is unknown
    bool travelling;           ///< in one of them
  };
  virtual ~WaveBlocks() = default;
  /// Averages the contact's tangents. Where the fundamental moves its blocks are made beside the point, where
  /// they are not singular. `SingularBlock` if one is. Collective.
  virtual void make(Point const&) = 0;
  /// Behind `make`, with what the contact of single sectors adds, eliminated with the compliance `local` of
  /// a sector, harmonics x rows x rows. Collective.
  virtual void couple(std::vector<complex> const&) {}
  /// B A^-1 B^H by wave, contact rows x contact rows, row-major.
  std::vector<complex> const& compliances() const { return compliances_; }
  /// A^-1 (x - B^H f), f for u = B A^-1 x; own waves x dofs. Collective.
  virtual std::vector<complex> solve(std::vector<complex> const& x, Forces const&) const = 0;
  /// Floating-point operations of `make` at a point beside the last.
  virtual double flops() const = 0;
  /// Of `solve`.
  virtual double applied_flops() const = 0;
  virtual double megabytes() const = 0;
  virtual std::string describe() const = 0;

 protected:
  /// The exponents where the fundamental's block is not singular.
  static Exponents beside(Exponents, int fundamental);
  std::vector<complex> compliances_;
};

}  // namespace fretwave::wheel
