#pragma once
#include <optional>

#include "blocked_product.h"
#include "hb/harmonics.h"
#include "hb/split_matrix.h"
#include "model/model.h"

namespace fretwave::hb {

/// Z = sum over the linear terms of A (x) c_n, c_n = s_n^p e^{-i k n theta}; with inertia damping g the mass
/// takes s^2 - g s.
class DynamicStiffness {
 public:
  DynamicStiffness(model::Model const&, Harmonics const&);
  /// y += Z x on harmonic-block vectors, of all terms or of those of one order. Collective.
  void multiply_add(Exponents const&, Vec x, Vec y, int order = -1);
  /// y += Z^T x. Collective.
  void transposed_multiply_add(Exponents const&, Vec x, Vec y);
  /// y += Z x, stiffness without its rounding (`SplitMatrix`, `exact_rows.h`): for residuals. Collective.
  void multiply_add_exactly(Exponents const&, Vec x, Vec y);
  /// y += dZ x for a change (ds, dg) of the exponents, always of the same x until it `has_moved`. Collective.
  void derivative_multiply_add(Exponents const&, Exponents const& change, Vec x, Vec y);
  void has_moved() { products_.clear(); }
  /// Rounding error to expect in Z x: eps sum |A| |c_n| |x|, with each dof's neighbours moving as itself;
  /// norm over all rows. Collective.
  double rounding(Exponents const&, Vec x) const;
  /// c_n of one term.
  std::vector<complex> coefficients(model::Term const&, Exponents const&) const;
  std::vector<complex> coefficient_derivatives(model::Term const&, Exponents const&,
                                               Exponents const& change) const;

  /// Places of the entries in the harmonic-block matrix (this rank's rows), and their values in the same
  /// order, scaled.
  void pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) const;
  double* values(Exponents const&, double scale, double* v) const;

 private:
  /// A (x) I_m, of a sparse matrix, or this rank's dense rows for a product of LAPACK's.
  struct Blocked {
    std::optional<BlockedProduct> sparse;
    std::vector<double> dense;  ///< local rows x all dofs, row-major
    bool cancels;               ///< a sparse stiffness of many dofs
    SplitMatrix split;          ///< of a dense stiffness
  };
  /// A term whose matrix is so many times that of the product.
  struct Part {
    size_t term;
    double times;
  };
  using Coefficients = std::vector<complex>;
  complex phase(model::Term const&, int n) const;
  void find_parts();
  template <class Of>
  Coefficients sum(std::vector<Part> const&, Of of) const;
  Coefficients coefficients(std::vector<Part> const&, Exponents const&, int order) const;
  void multiply_add(Exponents const&, Vec x, Vec y, int order, bool exactly);
  void accumulate(std::vector<complex> const& c, Blocked&, Vec x, Vec y, bool exactly = false);
  void accumulate_transposed(Coefficients const&, Blocked&, Vec x, Vec y);

  model::Model const& model_;
  Harmonics harmonics_;
  std::vector<Blocked> blocked_;
  std::vector<std::vector<Part>> parts_;       ///< of each of them: damping c K needs no product of its own
  std::vector<VecHandle> products_;            ///< A x of derivatives, by matrix; made when asked for
  std::vector<std::vector<double>> row_sums_;  ///< of |A|, one per term
  mutable std::vector<std::vector<MatEntry>> entries_;
  VecHandle work_;
};

}  // namespace fretwave::hb
