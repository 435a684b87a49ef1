#include "wheel/mean_sector.h"

#include <algorithm>

namespace fretwave::wheel {

MeanSector::MeanSector(model::Model const& model, WheelContact const& contact)
    : unit_(int(model.unit())), sectors_(int(model.dofs() / model.unit())), contact_rows_(contact.rows()) {
  std::vector<char> touched(unit_, 0);
  for (auto const& b : contact.entries()) touched[b.dof] = 1;
  for (int pass = 1; pass >= 0; --pass)
    for (int dof = 0; dof < unit_; ++dof)
      if (touched[dof] == pass) order_.push_back(dof);
  contact_dofs_ = int(std::ranges::count(touched, 1));
  position_.resize(unit_);
  for (int k = 0; k < unit_; ++k) position_[order_[k]] = k;
}

std::vector<Circulant<SparseBlock>> MeanSector::terms(model::Model const& model) const {
  std::vector<Circulant<SparseBlock>> out;
  for (auto const& term : model.terms()) out.push_back(mean_blocks(term.A, unit_, sectors_, position_));
  return out;
}

std::vector<complex> MeanSector::of_wave(Circulant<SparseBlock> const& blocks, int diameter) const {
  std::vector<complex> P(size_t(unit_) * unit_);
  for (auto const& [k, A] : blocks) {
    const complex t = turn(k, diameter);
    for_entries(A, [&](int row, int column, double a) { P[size_t(column) * unit_ + row] += t * a; });
  }
  return P;
}

std::vector<complex> MeanSector::of_wave(Circulant<std::vector<complex>> const& blocks, int diameter) const {
  std::vector<complex> P(size_t(unit_) * unit_);
  for (auto const& [k, A] : blocks) {
    const complex t = turn(k, diameter);
    for (size_t i = 0; i < P.size(); ++i) P[i] += t * A[i];
  }
  return P;
}

std::vector<complex> MeanSector::rows_of(int diameter, WheelContact const& contact) const {
  std::vector<complex> B(size_t(contact_rows_) * contact_dofs_);
  for (auto const& b : contact.entries())
    B[size_t(b.row) * contact_dofs_ + position_[b.dof]] += b.value * turn(b.ahead, diameter);
  return B;
}

}  // namespace fretwave::wheel
