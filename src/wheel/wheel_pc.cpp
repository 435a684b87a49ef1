#include "wheel/wheel_pc.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <numbers>

#include "error.h"
#include "precondition/kinds.h"
#include "together.h"
#include "tuned.h"

namespace fretwave::wheel {

namespace {

const Tuned beside("wheel_beside", 1e-3,
                   "relative shift of the fundamental's exponent from where its block is singular");
const Tuned far("wheel_far", 1e-2, "relative change of the exponents that makes the blocks stale");
const Tuned pure("wheel_pure", 0.999, "share of the largest wave in a travelling one");
const Tuned faint("wheel_faint", 1e-6, "share of a wave in the motion that counts as none");

}  // namespace

/// Every sector has the same pairs on the same of its dofs: those of a rank are numbered sector by sector.
bool WheelPreconditioner::suits(HarmonicProblem const& problem) {
  model::Model const& model = problem.model();
  const PetscInt unit = model.unit(), sectors = model.dofs() / unit;
  int repeats = model.dofs() % unit == 0;
  for (auto const& contact : model.contacts()) {
    PetscInt64 pairs = contact.law->pairs();
    MPI_Allreduce(MPI_IN_PLACE, &pairs, 1, MPIU_INT64, MPI_SUM, model.comm());
    if (pairs % sectors != 0 || !contact.ahead.empty()) return false;
    const int d = contact.law->components(), in_sector = int(pairs / sectors);
    // (pair in its sector, component, sectors ahead, dof) -> how many of this rank's pairs have it
    std::map<std::array<PetscInt, 4>, int> places;
    PetscInt begin;
    check(MatGetOwnershipRange(contact.B, &begin, nullptr));
    for_entries(contact.B, [&](PetscInt row, PetscInt dof, double) {
      const int number = contact.numbers[(row - begin) / d];
      const PetscInt ahead = (dof / unit - number / in_sector + sectors) % sectors;
      ++places[{number % in_sector, (row - begin) % d, ahead, dof % unit}];
    });
    std::vector<int> mine(in_sector, 0);
    for (int number : contact.numbers) ++mine[number % in_sector];
    for (auto const& [place, count] : places) repeats = repeats && count == mine[size_t(place[0])];
  }
  MPI_Allreduce(MPI_IN_PLACE, &repeats, 1, MPI_INT, MPI_LAND, model.comm());
  return repeats;
}

WheelPreconditioner::WheelPreconditioner(HarmonicProblem& problem)
    : problem_(problem),
      unit_(int(problem.model().unit())),
      sectors_(int(problem.model().dofs() / problem.model().unit())),
      m_(problem.harmonics().block_size()),
      harmonics_(problem.harmonics().count()),
      local_sectors_(int(problem.model().local_dofs() / problem.model().unit())),
      dofs_(local_sectors_, harmonics_, unit_, problem.comm()),
      contact_(problem, dofs_) {
  find_order();
  for (auto const& term : problem.model().terms()) terms_.push_back(average(term.A));
  inverse_.emplace(dofs_.waves(), sectors_, unit_, symmetric());
  rows_.emplace(local_sectors_, harmonics_, contact_.rows(), problem.comm());
  for (Wave const& wave : dofs_.waves()) B_.push_back(rows_of(wave.diameter));
}

void WheelPreconditioner::find_order() {
  std::vector<char> touched(unit_, 0);
  for (auto const& b : contact_.entries()) touched[b.dof] = 1;
  for (int pass = 1; pass >= 0; --pass)
    for (int dof = 0; dof < unit_; ++dof)
      if (touched[dof] == pass) order_.push_back(dof);
  contact_dofs_ = int(std::ranges::count(touched, 1));
  position_.resize(unit_);
  for (int k = 0; k < unit_; ++k) position_[order_[k]] = k;
}

/// A_k: mean over the sectors of the block that acts on the sector k places ahead. Collective.
WheelPreconditioner::Blocks WheelPreconditioner::average(Mat A) const {
  Blocks mine, all;
  for_entries(A, [&](PetscInt row, PetscInt col, double value) {
    auto& block = mine[int(col / unit_ - row / unit_ + sectors_) % sectors_];
    block.resize(size_t(unit_) * unit_);
    block[size_t(position_[col % unit_]) * unit_ + position_[row % unit_]] += value / sectors_;
  });
  std::vector<int> ahead;
  for (auto const& [k, block] : mine) ahead.push_back(k);
  for (int k : gathered(std::span<int const>(ahead), problem_.comm())) all.try_emplace(k);
  for (auto& [k, block] : all) {
    if (mine.contains(k)) block = std::move(mine[k]);
    block.resize(size_t(unit_) * unit_);
    sum_over_ranks(block, problem_.comm());
  }
  return all;
}

/// A_-k = A_k^T in all terms.
bool WheelPreconditioner::symmetric() const {
  for (Blocks const& term : terms_) {
    double size = 0, change = 0;
    for (auto const& [k, A] : term) {
      const auto other = term.find((sectors_ - k) % sectors_);
      if (other == term.end()) return false;
      for (int j = 0; j < unit_; ++j)
        for (int i = 0; i < unit_; ++i) {
          const double a = A[size_t(j) * unit_ + i];
          size = std::max(size, std::abs(a));
          change = std::max(change, std::abs(a - other->second[size_t(i) * unit_ + j]));
        }
    }
    if (change > 1e-9 * size) return false;
  }
  return true;
}

std::vector<complex> WheelPreconditioner::rows_of(int diameter) const {
  std::vector<complex> B(size_t(contact_.rows()) * contact_dofs_);
  for (auto const& b : contact_.entries())
    B[size_t(b.row) * contact_dofs_ + position_[b.dof]] +=
        b.value *
        std::polar(1.0, 2 * std::numbers::pi * double(size_t(b.ahead) * diameter % sectors_) / sectors_);
  return B;
}

bool WheelPreconditioner::moved(Exponents const& e) const {
  if (!made_at_ || made_in_ != problem_.stiffness_scale()) return true;
  double change = std::abs(e.inertia_damping - made_at_->inertia_damping), size = 0;
  for (size_t i = 0; i < e.s.size(); ++i) {
    change = std::max(change, std::abs(e.s[i] - made_at_->s[i]));
    size = std::max(size, std::abs(e.s[i]));
  }
  return change > far * size;
}

CirculantBlocks<complex> WheelPreconditioner::blocks(int harmonic, Exponents const& e) const {
  CirculantBlocks<complex> out;
  const auto block = [&](int k) -> std::vector<complex>& {
    auto& A = out[k];
    A.resize(size_t(unit_) * unit_);
    return A;
  };
  for (size_t j = 0; j < terms_.size(); ++j) {
    const complex c = problem_.terms().stiffness().coefficients(problem_.model().terms()[j], e)[harmonic] /
                      problem_.stiffness_scale();
    for (auto const& [k, A] : terms_[j]) {
      auto& sum = block(k);
      for (size_t i = 0; i < A.size(); ++i) sum[i] += c * A[i];
    }
  }
  std::vector<std::vector<WheelContact::Entry>> by_row(contact_.rows());
  for (auto const& b : contact_.entries()) by_row[b.row].push_back(b);
  contact_.for_tangents(harmonic, [&](int r, int c, complex t) {
    for (auto const& a : by_row[r])
      for (auto const& b : by_row[c])
        block((b.ahead - a.ahead + sectors_) %
              sectors_)[size_t(position_[b.dof]) * unit_ + position_[a.dof]] += a.value * b.value * t;
  });
  return out;
}

/// The fundamental's blocks follow each point: where a family of modes is dense, some are nearly singular,
/// and a small change matters. Those of the waves in the motion are made beside it.
void WheelPreconditioner::factorise(Exponents const& e, std::vector<double> const& shares) {
  const int first = problem_.harmonics().fundamental();
  const auto moving = [&](Wave const& wave) {
    return problem_.scalar_count() > 1 &&
           std::max(shares[wave.diameter], shares[(sectors_ - wave.diameter) % sectors_]) > 0;
  };
  const auto at = [this](Exponents const& point) {
    return [this, &point](int harmonic) { return blocks(harmonic, point); };
  };
  const bool all = moved(e);
  const Exponents kept = made_at_.value_or(e);
  made_at_.reset();  // until every rank has its blocks
  if (all) contact_.average(symmetric());
  Exponents shifted = e;
  shifted.s[first] *= 1 + beside;
  together(problem_.comm(), "inverting the waves' blocks", [&] {
    if (all) inverse_->make([&](Wave const& wave) { return wave.harmonic != first; }, at(e));
    inverse_->make([&](Wave const& wave) { return wave.harmonic == first && !moving(wave); }, at(e));
    inverse_->make([&](Wave const& wave) { return wave.harmonic == first && moving(wave); }, at(shifted));
    G_ = compliances();
  });
  made_at_ = all ? e : kept, made_in_ = problem_.stiffness_scale();
}

/// This rank's harmonic blocks as sectors x harmonics x places, q = qc - i qs.
std::vector<complex> WheelPreconditioner::gather(double const* x) const {
  Harmonics const& h = problem_.harmonics();
  std::vector<complex> out(size_t(local_sectors_) * harmonics_ * unit_);
  for (int j = 0; j < local_sectors_; ++j)
    for (int k = 0; k < unit_; ++k) {
      double const* block = x + (size_t(j) * unit_ + order_[k]) * m_;
      for (int i = 0; i < harmonics_; ++i) {
        double const* q = block + h.offset(i);
        out[(size_t(j) * harmonics_ + i) * unit_ + k] = {q[0], h.orders()[i] ? -q[1] : 0.0};
      }
    }
  return out;
}

/// Shares of the fundamental's energy in the waves d. Collective.
std::vector<double> WheelPreconditioner::spectrum(Vec y) const {
  const auto waves = dofs_.to_waves(gather(ReadArray(y).data()));
  std::vector<double> shares(sectors_, 0.0);
  for (size_t w = 0; w < dofs_.waves().size(); ++w)
    if (dofs_.waves()[w].harmonic == problem_.harmonics().fundamental())
      for (int i = 0; i < unit_; ++i) shares[dofs_.waves()[w].diameter] += std::norm(waves[w * unit_ + i]);
  MPI_Allreduce(MPI_IN_PLACE, shares.data(), sectors_, MPI_DOUBLE, MPI_SUM, problem_.comm());
  double sum = 0, left = 0;
  for (double s : shares) sum += s;
  const double none = faint * sum;
  for (double& s : shares) left += s = sum == 0 ? 1.0 / sectors_ : s > none ? s : 0;
  for (double& s : shares) s /= left;
  return shares;
}

/// B A^-1 B^H of this rank's waves.
std::vector<complex> WheelPreconditioner::compliances() const {
  const int c = contact_.rows(), k = contact_dofs_;
  std::vector<complex> G(B_.size() * c * c), VB(size_t(k) * c);
  for (size_t w = 0; w < B_.size(); ++w) {
    std::ranges::fill(VB, 0);
    for (int r = 0; r < c; ++r)
      for (int j = 0; j < k; ++j)
        if (const complex b = B_[w][size_t(r) * k + j]; b != 0.0)
          for (int i = 0; i < k; ++i)
            VB[size_t(r) * k + i] += complex(inverse_->entry(w, i, j)) * std::conj(b);
    for (int a = 0; a < c; ++a)
      for (int i = 0; i < k; ++i)
        if (const complex b = B_[w][size_t(a) * k + i]; b != 0.0)
          for (int r = 0; r < c; ++r) G[(w * c + a) * c + r] += b * VB[size_t(r) * k + i];
  }
  return G;
}

/// The compliance of a sector's rows while the fundamental is in the waves d by these shares, and harmonic n
/// in their n d; harmonics x rows x rows. Collective.
std::vector<complex> WheelPreconditioner::met(std::vector<double> const& shares) const {
  const size_t square = size_t(contact_.rows()) * contact_.rows();
  std::vector<complex> G(harmonics_ * square);
  for (size_t w = 0; w < B_.size(); ++w) {
    auto const& [harmonic, diameter] = dofs_.waves()[w];
    double share = 0;
    for (int d = 0; d < sectors_; ++d)
      if (size_t(problem_.harmonics().orders()[harmonic]) * d % sectors_ == size_t(diameter))
        share += shares[d];
    for (size_t k = 0; k < square && share > 0; ++k) G[harmonic * square + k] += share * G_[w * square + k];
  }
  sum_over_ranks(G, problem_.comm());
  return G;
}

/// By waves about a travelling wave, sector by sector about any other motion. Collective.
void WheelPreconditioner::eliminate(std::vector<double> const& shares) {
  const auto main = std::ranges::max_element(shares);
  if (*main < pure) {
    travelling_.reset();
    return contact_.eliminate(met(shares));
  }
  const int wave = int(main - shares.begin());
  if (!travelling_ || travelling_->wave() != wave)
    travelling_.emplace(contact_, problem_.harmonics(), local_sectors_, wave, problem_.comm());
  travelling_->set_compliance(G_);
  travelling_->eliminate();
}

/// A^-1 (x - B^T E B A^-1 x) of this rank's harmonic blocks. Collective.
std::vector<double> WheelPreconditioner::solve(double const* x) const {
  Harmonics const& h = problem_.harmonics();
  const int c = contact_.rows(), k = contact_dofs_;
  const auto in = dofs_.to_waves(gather(x));
  std::vector<complex> q(in.size()), u(B_.size() * c), g(k);
  for (size_t w = 0; w < B_.size(); ++w) {
    std::ranges::copy(inverse_->multiply(w, unit_, &in[w * unit_]), &q[w * unit_]);
    for (int r = 0; r < c; ++r)
      for (int i = 0; i < k; ++i) u[w * c + r] += B_[w][size_t(r) * k + i] * q[w * unit_ + i];
  }
  if (c > 0) {
    const auto sectors = rows_->to_sectors(u);
    const auto f = rows_->to_waves(travelling_ ? travelling_->apply(sectors) : contact_.apply(sectors));
    for (size_t w = 0; w < B_.size(); ++w) {
      std::ranges::fill(g, 0);
      for (int r = 0; r < c; ++r)
        for (int i = 0; i < k; ++i) g[i] += std::conj(B_[w][size_t(r) * k + i]) * f[w * c + r];
      const auto added = inverse_->multiply(w, k, g.data());
      for (int i = 0; i < unit_; ++i) q[w * unit_ + i] -= added[i];
    }
  }
  const auto out = dofs_.to_sectors(q);
  std::vector<double> z(size_t(local_sectors_) * unit_ * m_);
  for (int j = 0; j < local_sectors_; ++j)
    for (int i = 0; i < harmonics_; ++i)
      for (int p = 0; p < unit_; ++p) {
        const complex a = out[(size_t(j) * harmonics_ + i) * unit_ + p];
        double* at = &z[(size_t(j) * unit_ + order_[p]) * m_ + h.offset(i)];
        at[0] = a.real();
        if (h.orders()[i]) at[1] = -a.imag();
      }
  return z;
}

/// Columns of the unfolding and of the scalars; rows of the normalisation, the unfolding and the closing.
void WheelPreconditioner::make_border(Vec y, Vec row) {
  model::Model const& model = problem_.model();
  Harmonics const& h = problem_.harmonics();
  const size_t local = size_t(model.local_dofs()) * m_;
  std::vector<Border::Local> columns, rows;
  const auto copy = [&](Vec v) {
    const ReadArray in(v);
    return Border::Local(in.data(), in.data() + local);
  };
  for (auto const& g : problem_.unfolding().vectors()) columns.push_back(copy(g));
  for (int part = 0; part < problem_.scalar_count() - 1; ++part) {
    rows.emplace_back(local, 0.0);
    for (auto const& [dof, weight] : problem_.row()) {
      const PetscInt own = dof - model.first_dof();
      if (own >= 0 && own < model.local_dofs())
        rows.back()[own * m_ + h.offset(h.fundamental()) + part] = weight;
    }
  }
  rows.insert(rows.end(), columns.begin(), columns.end());
  for (int j = 0; j < problem_.scalar_count(); ++j) columns.push_back(copy(problem_.scalar_column(y, j)));
  rows.push_back(copy(row));
  const size_t size = rows.size();
  std::vector<double> S(size * size, 0.0);
  if (problem_.last_rank()) {
    const ReadArray closing(row);
    for (size_t j = 0; j < size; ++j) S[j * size + size - 1] = closing[PetscInt(local + j)];
  }
  MPI_Bcast(S.data(), int(S.size()), MPI_DOUBLE, comm_size(problem_.comm()) - 1, problem_.comm());
  border_.make([this](double const* x) { return solve(x); }, columns, std::move(rows), std::move(S),
               problem_.comm());
}

void WheelPreconditioner::build(Vec y, Vec row) {
  const Exponents e = problem_.scaled(y).exponents;
  auto contacts = problem_.pair_tangents(y);
  contact_.take(contacts);
  const auto shares = spectrum(y);
  factorise(e, shares);
  if (contact_.rows() > 0) eliminate(shares);
  make_border(y, row);
}

void WheelPreconditioner::apply(Vec x, Vec z) { border_.apply(ReadArray(x).data(), WriteArray(z).data()); }

/// Five applications for the border; the fundamental's inverses (n^3 flops) and the contact's elimination,
/// 16/3 n^3 flops a sector, at the speed of matrix products, against 8 n^2 of an application that are read
/// from memory.
double WheelPreconditioner::build_cost() const {
  const double size = 2.0 * contact_.largest_group() * harmonics_ / m_, n = unit_;
  return 6 + (4 * n * n * n + 16.0 / 3 * size * size * size) / 10 / (8.0 * n * n * harmonics_);
}

std::string WheelPreconditioner::describe() const {
  char text[160];
  std::snprintf(text, sizeof text, "%d nodal diameters of %d dofs, %.0f MB on rank 0", sectors_, unit_,
                inverse_->megabytes());
  return text;
}

void register_kinds() {
  const auto whole_wheel = [](HarmonicProblem const& problem) { return problem.model().unit() > 0; };
  const auto not_waves = [=](HarmonicProblem const& problem) -> std::string {
    if (!whole_wheel(problem)) return "a model that is no whole wheel";
    return WheelPreconditioner::suits(problem) ? "" : "contact not the same in all sectors";
  };
  solve::register_kind(harmonic_kind<WheelPreconditioner>("fwwheel", "", whole_wheel, not_waves));
}

}  // namespace fretwave::wheel
