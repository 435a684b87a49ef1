#pragma once
#include "model/stuck_basis.h"
#include "precondition/harmonic_block.h"

namespace fretwave::precondition {

/// What stands beside the fundamental's rows, in the basis: columns of the scalars and rows that close the
/// system, each cosine then sine over the modes, and what scalars do in those rows, column-major.
struct ModalBorder {
  int scalars = 0;
  std::vector<double> columns, rows, corner;
};

/// The harmonic blocks Z_n + B^T (k + T) B of a range of harmonics in the basis of stuck pairs, where Z_n +
/// B^T k B is diagonal: z (Laxalde et al. 2008, eq. 7). T is what the mean stiffness of some pairs over a
/// period lacks of the stuck one, the same at all harmonics. The higher modes follow statically, G = U_h
/// U_h^T / k_ref; then X = (1 + T G)^-1 T, one real matrix, takes T out of all harmonics, and what is left of
/// each is a small block
///
///     N_n = z_n + U_l^T X U_l
///
/// of the lower modes, that of the fundamental with its border, without which it is singular at an
/// eigenvalue. Arrays hold the range's coefficients innermost, filled up with zeros to `lead`.
class ModalBlocks {
 public:
  /// Harmonics first to last - 1.
  ModalBlocks(model::StuckBasis const&, Harmonics const&, int first, int last);
  int coefficients() const { return count_; }
  int lead() const { return lead_; }
  /// Where they begin in a harmonic block.
  int begin() const { return begin_; }
  bool has_fundamental() const { return border_harmonic_ >= 0; }

  /// z by harmonic of the range and mode, `at_rest` for a mode that moves statically; the border if the
  /// fundamental is in the range.
  void set_structure(std::vector<std::vector<complex>> z, double at_rest, ModalBorder border);
  struct Entry {
    int row, col;
    double value;
  };
  /// T between some rows of B, by their places among these. `SingularBlock` if the blocks are.
  void set_contact(std::vector<int> const& rows, std::vector<Entry> T);
  /// T of further rows, by their places among these, behind those that there are.
  void add_contact(std::vector<int> const& rows, std::vector<Entry> const& T);
  int rows() const { return int(rows_.size()); }
  /// Flops of the blocks of the lower modes, which are made anew with every change of T.
  double small_flops() const;

  /// Modes, and the border's scalars where it is.
  struct Solution {
    std::vector<float> modes;
    std::vector<double> scalars;
  };
  /// Of forces on the modes and on the border's rows.
  Solution solve(std::vector<float> const& forces, std::vector<double> const& closing) const;
  /// Motion of the rows, U eta.
  std::vector<float> motion(std::vector<float> const& modes) const;
  /// forces -= U^T f of forces on the rows.
  void subtract(std::vector<float> const& f, std::vector<float>& forces) const;
  /// Motion of the rows under forces on them: the blocks' compliance.
  std::vector<float> compliance(std::vector<float> const& f) const;
  /// Of some groups of rows at a harmonic of the range, each group among itself, row by row; a group by its
  /// first place and how many rows it has.
  struct Group {
    int first, rows;
  };
  std::vector<Rotation> compliance(int harmonic, std::vector<Group> const& groups) const;

 private:
  /// Block N_n of the lower modes, inverted: parts (cosine, sine) x modes, then scalars; complex where there
  /// are two parts that no scalars tell apart.
  struct Small {
    int at, parts, scalars, size;
    std::vector<double> real_inverse;
    std::vector<std::complex<float>> complex_inverse;
  };
  void make_small(int i);
  std::vector<std::complex<float>> inverse(std::vector<complex> const& z) const;
  std::vector<double> inverse(Small const&, std::vector<complex> const& z) const;
  void add_border(Small const&, std::vector<double>& N) const;
  void set_static_compliance();
  void take_rows(std::vector<int> const& rows);
  template <class Real>
  void set_inverse(std::vector<Real> G);
  template <class Real>
  std::vector<Real> static_compliance(std::vector<int> const& to, std::vector<int> const& from) const;
  void set_border();
  void border_rows(std::vector<int> const& rows);
  template <class Real>
  void couple_border(std::vector<Real> const& transposed_g);
  template <class Real>
  std::vector<Real> times_T(std::vector<Real> const& x, bool transposed) const;
  void add_T(std::vector<float> const& u, std::vector<float>& to) const;
  std::vector<float> pull(std::vector<float> u) const;
  std::vector<double> small_solutions(Small const&, std::vector<double> const& right) const;
  std::vector<double> of_parts(Small const&, std::vector<float> const& low) const;
  void put_parts(Small const&, std::vector<double> const& x, std::vector<float>& low) const;

  model::StuckBasis const& basis_;
  int first_, begin_ = 0, count_ = 0, lead_ = 0, modes_, low_ = 0, border_harmonic_ = -1;
  std::vector<int> offsets_, parts_;            ///< of the range's harmonics among its coefficients
  std::vector<std::vector<complex>> flexible_;  ///< 1 / z; of higher modes near resonance 1 / at_rest
  std::vector<std::vector<complex>> z_;
  double at_rest_ = 1;
  ModalBorder border_;
  std::vector<double> static_;  ///< G of all rows of B, with so many lower modes and this stiffness at rest
  int static_low_ = -1;
  double static_at_rest_ = 0;
  std::vector<int> rows_;
  std::vector<Entry> T_;
  std::vector<float> motions_;       ///< U^T of the rows, a column each
  std::vector<float> G_;             ///< (G (1 + T G)^-1)^T, column-major
  std::vector<float> left_, right_;  ///< (1 - G X) U_l and U_l^T (1 + T G)^-1
  std::vector<double> H_;
  /// Of the border by scalar and part: z^-1 C_h, R_h z^-1; c and rho; X c, c - G X c; rho X, rho (1 + T
  /// G)^-1; its corner.
  std::vector<double> moved_, pulled_, columns_, rows_of_forces_, X_columns_, left_columns_, rows_X_,
      right_rows_, schur_;
  std::vector<Small> small_;
};

}  // namespace fretwave::precondition
