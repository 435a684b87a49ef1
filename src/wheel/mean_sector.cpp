#include "wheel/mean_sector.h"

#include <algorithm>
#include <cmath>
#include <numbers>

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

std::vector<CirculantBlocks<double>> MeanSector::terms(model::Model const& model) const {
  std::vector<CirculantBlocks<double>> out;
  for (auto const& term : model.terms()) out.push_back(average(term.A, model.comm()));
  return out;
}

CirculantBlocks<double> MeanSector::average(Mat A, MPI_Comm comm) const {
  CirculantBlocks<double> mine, all;
  for_entries(A, [&](PetscInt row, PetscInt col, double value) {
    auto& block = mine[int(col / unit_ - row / unit_ + sectors_) % sectors_];
    block.resize(size_t(unit_) * unit_);
    block[size_t(position_[col % unit_]) * unit_ + position_[row % unit_]] += value / sectors_;
  });
  std::vector<int> ahead;
  for (auto const& [k, block] : mine) ahead.push_back(k);
  for (int k : gathered(std::span<int const>(ahead), comm)) all.try_emplace(k);
  for (auto& [k, block] : all) {
    if (mine.contains(k)) block = std::move(mine[k]);
    block.resize(size_t(unit_) * unit_);
    sum_over_ranks(block, comm);
  }
  return all;
}

bool MeanSector::symmetric(CirculantBlocks<double> const& blocks) const {
  double size = 0, change = 0;
  for (auto const& [k, A] : blocks) {
    const auto other = blocks.find((sectors_ - k) % sectors_);
    if (other == blocks.end()) return false;
    for (int j = 0; j < unit_; ++j)
      for (int i = 0; i < unit_; ++i) {
        const double a = A[size_t(j) * unit_ + i];
        size = std::max(size, std::abs(a));
        change = std::max(change, std::abs(a - other->second[size_t(i) * unit_ + j]));
      }
  }
  return change <= 1e-9 * size;
}

complex MeanSector::turn(int ahead, int diameter) const {
  return std::polar(1.0, 2 * std::numbers::pi * double(size_t(ahead) * diameter % sectors_) / sectors_);
}

std::vector<complex> MeanSector::rows_of(int diameter, WheelContact const& contact) const {
  std::vector<complex> B(size_t(contact_rows_) * contact_dofs_);
  for (auto const& b : contact.entries())
    B[size_t(b.row) * contact_dofs_ + position_[b.dof]] += b.value * turn(b.ahead, diameter);
  return B;
}

}  // namespace fretwave::wheel
