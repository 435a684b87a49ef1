#pragma once
#include "contact/coulomb.h"

namespace fretwave::contact {

/// Elastic Coulomb contact in three dimensions, with a circular slip limit over both tangents: sliders are
/// pulled along their paths between samples (`march`), over the period that they close (`SliderClosure`).
class Coulomb3d : public Coulomb {
 public:
  explicit Coulomb3d(CoulombParameters p) : Coulomb(std::move(p), 2) {}
  Limit limit() const override { return Limit::circle; }
  /// Without friction: stops, whose sliders hold nothing.
  Integration integration() const override;
  void force(Motion const&, double* f, Record&) const override;
  void product(Motion const&, Record const&, double const* du, double const* dv, double* df) const override;
  void pair_product(Motion const&, Record const&, int pair, int columns, double const* du,
                    double* df) const override;
  std::uint64_t piece(Motion const&, Record const&) const override;

 protected:
  void set_rest(double const* u) override;

 private:
  void close(Motion const&, std::vector<double> const& rest, std::vector<double> const& left, double const* f,
             std::vector<double>& w, Record&) const;
  void linearised(Motion const&, Record const&, int pair, int n, double const* du, double* df) const;
};

Entry coulomb_3d_entry();

}  // namespace fretwave::contact
