#include "wheel/sector_transform.h"

#include <algorithm>
#include <numeric>

#include "log.h"

namespace fretwave::wheel {

SectorTransform::SectorTransform(int local_sectors, int harmonics, int items, MPI_Comm comm)
    : harmonics_(harmonics), items_(items), rank_(comm_rank(comm)), size_(comm_size(comm)), exchange_(comm) {
  first_sector_ = gathered(std::span<int const>(&local_sectors, 1), comm);
  first_sector_.insert(first_sector_.begin(), 0);
  std::partial_sum(first_sector_.begin(), first_sector_.end(), first_sector_.begin());

  // a rank never sends more than it holds, as pairs of numbers, with two a rank to say whose they are
  for (int r = 0; r < size_; ++r)
    as_int(2 * (PetscInt64(first_sector_[r + 1] - first_sector_[r]) * harmonics * items + size_),
           "coefficients of a rank's sectors");
  as_int(2 * (PetscInt64(sectors()) * (share(harmonics * items, 1, size_) + 1) + size_),
         "coefficients of a rank's waves");
  const int n = sectors(), half = n / 2 + 1;
  for (int r = 0; r < size_; ++r) {
    waves_.emplace_back();
    for (int b = share(harmonics * half, r, size_); b < share(harmonics * half, r + 1, size_); ++b) {
      const int harmonic = b % harmonics, d = b / harmonics;
      waves_.back().push_back({harmonic, d});
      if (d != (n - d) % n) waves_.back().push_back({harmonic, n - d});
    }
  }
  const int columns = width(rank_);
  columns_.resize(size_t(n) * columns);
  auto* data = reinterpret_cast<fftw_complex*>(columns_.data());
  const auto plan = [&](int sign) {
    return fftw_plan_many_dft(1, &n, columns, data, nullptr, columns, 1, data, nullptr, columns, 1, sign,
                              FFTW_ESTIMATE);
  };
  if (columns) forward_.reset(plan(FFTW_FORWARD)), backward_.reset(plan(FFTW_BACKWARD));
}

/// Columns of a harmonic that a rank transforms, from and to.
std::pair<int, int> SectorTransform::common(int columns_of, int harmonic) const {
  const int begin = std::max(first_column(columns_of), harmonic * items_);
  return {begin, std::max(begin, std::min(first_column(columns_of + 1), (harmonic + 1) * items_))};
}

/// visit(number of the wave on its rank, wave, first column, columns) for what two ranks exchange.
template <class Visit>
void SectorTransform::for_runs(int columns_of, int waves_of, Visit visit) const {
  for (size_t w = 0; w < waves_[waves_of].size(); ++w) {
    const auto [begin, end] = common(columns_of, waves_[waves_of][w].harmonic);
    if (end > begin) visit(w, waves_[waves_of][w], begin, end - begin);
  }
}

void SectorTransform::exchange(std::span<complex const> out, Counts const& sent,
                               std::span<complex> in) const {
  Counts numbers(sent);
  for (int& count : numbers) count *= 2;
  exchange_({reinterpret_cast<double const*>(out.data()), 2 * out.size()}, numbers,
            {reinterpret_cast<double*>(in.data()), 2 * in.size()});
}

/// Entries of this rank's waves by the rank of their columns, or of its columns by the rank of their waves.
SectorTransform::Counts SectorTransform::by_rank(bool waves) const {
  Counts counts(size_, 0);
  for (int r = 0; r < size_; ++r)
    for_runs(waves ? r : rank_, waves ? rank_ : r,
             [&](size_t, Wave const&, int, int columns) { counts[r] += columns; });
  return counts;
}

std::vector<complex> SectorTransform::to_waves(std::span<complex const> in) const {
  static const log::Event transform("FwTransform");
  const log::Span span(transform);
  Counts sent(size_);
  std::vector<complex> out;
  out.reserve(in.size());
  for (int r = 0; r < size_; ++r) {
    for (int j = 0; j < local_sectors(rank_); ++j) {
      const auto* from = in.data() + size_t(j) * harmonics_ * items_ + first_column(r);
      out.insert(out.end(), from, from + width(r));
    }
    sent[r] = local_sectors(rank_) * width(r);
  }
  exchange(out, sent, columns_);
  auto* data = reinterpret_cast<fftw_complex*>(columns_.data());
  if (forward_) fftw_execute_dft(forward_.get(), data, data);

  out.clear();
  for (int r = 0; r < size_; ++r)
    for_runs(rank_, r, [&](size_t, Wave const& wave, int begin, int columns) {
      const auto* from = &columns_[size_t(wave.diameter) * width(rank_) + begin - first_column(rank_)];
      out.insert(out.end(), from, from + columns);
    });
  std::vector<complex> all(waves().size() * items_), mine(all.size());
  exchange(out, by_rank(false), mine);
  auto next = mine.begin();
  for (int r = 0; r < size_; ++r)
    for_runs(r, rank_, [&](size_t w, Wave const& wave, int begin, int columns) {
      std::copy_n(next, columns, &all[w * items_ + begin - wave.harmonic * items_]);
      next += columns;
    });
  return all;
}

std::vector<complex> SectorTransform::to_sectors(std::span<complex const> in) const {
  static const log::Event transform("FwTransform");
  const log::Span span(transform);
  std::vector<complex> out;
  out.reserve(in.size());
  for (int r = 0; r < size_; ++r)
    for_runs(r, rank_, [&](size_t w, Wave const& wave, int begin, int columns) {
      const auto* from = in.data() + w * items_ + begin - wave.harmonic * items_;
      out.insert(out.end(), from, from + columns);
    });
  std::vector<complex> mine(columns_.size());
  exchange(out, by_rank(true), mine);
  auto next = mine.begin();
  for (int r = 0; r < size_; ++r)
    for_runs(rank_, r, [&](size_t, Wave const& wave, int begin, int columns) {
      std::copy_n(next, columns,
                  &columns_[size_t(wave.diameter) * width(rank_) + begin - first_column(rank_)]);
      next += columns;
    });
  auto* data = reinterpret_cast<fftw_complex*>(columns_.data());
  if (backward_) fftw_execute_dft(backward_.get(), data, data);

  Counts sent(size_);
  out.clear();
  const double scale = 1.0 / sectors();
  for (complex const& c : columns_) out.emplace_back(scale * c);
  for (int r = 0; r < size_; ++r) sent[r] = local_sectors(r) * width(rank_);
  std::vector<complex> all(size_t(local_sectors(rank_)) * harmonics_ * items_), got(all.size());
  exchange(out, sent, got);
  next = got.begin();
  for (int r = 0; r < size_; ++r)
    for (int j = 0; j < local_sectors(rank_); ++j, next += width(r))
      std::copy_n(next, width(r), &all[size_t(j) * harmonics_ * items_ + first_column(r)]);
  return all;
}

}  // namespace fretwave::wheel
