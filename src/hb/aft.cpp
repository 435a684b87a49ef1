#include "hb/aft.h"

#include <algorithm>
#include <numbers>

#include "lapack.h"

namespace fretwave::hb {

namespace {

int tangent_columns(contact::Law const& law) { return law.components() * law.components() * law.pairs(); }

}  // namespace

Aft::Aft(Harmonics const& h, std::shared_ptr<contact::Law const> law, bool continuous)
    : harmonics_(h),
      law_(std::move(law)),
      pairs_(law_->pairs()),
      columns_(law_->components() * pairs_),
      law_samples_(h.odd_only() && law_->odd() && !law_->hereditary() ? h.samples() / 2 : h.samples()),
      tiles_(tiles(*law_, h.samples())),
      transform_(h, continuous ? 0 : law_->components() * tiles_.front().pairs, law_->components()),
      last_transform_(h, continuous || tiles_.size() == 1 ? 0 : law_->components() * tiles_.back().pairs,
                      law_->components()),
      tangent_transform_(h, law_->hereditary() ? 0 : tangent_columns(*law_)) {
  if (continuous) {
    if (law_->uses_velocity()) velocity_.resize(size_t(columns_) * h.block_size());
    continuous_ = continuous_force(h, *law_);
    return;
  }
  const size_t columns = law_->components() * tiles_.front().pairs, n = h.samples() * columns;
  f_.resize(n);
  if (law_->uses_displacement()) u_.resize(n);
  if (law_->uses_velocity()) v_.resize(n), velocity_.resize(columns * h.block_size());
}

/// Only a law with memory is cut: it goes over its samples twice and keeps a record.
std::vector<Aft::Tile> Aft::tiles(contact::Law const& law, int samples) {
  const int pairs = law.pairs(), size = law.hereditary() ? (samples <= 128 ? 64 : 32) : std::max(1, pairs);
  std::vector<Tile> out;
  for (int first = 0; first == 0 || first < pairs; first += size)
    out.push_back({first, std::min(size, pairs - first), {}});
  return out;
}

/// The fundamental's Im s turns sample numbers into time.
double Aft::angular_frequency(Exponents const& e) const {
  return harmonics_.fundamental() < 0 ? 1.0 : e.s[harmonics_.fundamental()].imag();
}

contact::Motion Aft::motion(Tile const& tile, double omega) const {
  return {.samples = law_samples_,
          .components = law_->components(),
          .pairs = tile.pairs,
          .first = tile.first,
          .u = u_.empty() ? nullptr : u_.data(),
          .v = v_.empty() ? nullptr : v_.data(),
          .step = 2 * std::numbers::pi / (omega * harmonics_.samples())};
}

/// Second half of a half-wave symmetric period from its first half.
void Aft::mirror(std::vector<double>& samples, double sign, int columns) const {
  if (law_samples_ == harmonics_.samples()) return;
  const size_t half = size_t(law_samples_) * columns;
  for (size_t k = 0; k < half; ++k) samples[half + k] = sign * samples[k];
}

void Aft::force(double const* U, Exponents const& e, double* F) {
  if (columns_ == 0) return;
  if (continuous_) {
    if (law_->uses_velocity()) multiply(harmonics_, e.s, U, velocity_.data(), columns_);
    return continuous_->force(U, law_->uses_velocity() ? velocity_.data() : nullptr, F);
  }
  for (Tile& tile : tiles_) {
    const int columns = tile.pairs * law_->components();
    const size_t at = size_t(tile.first) * law_->components() * harmonics_.block_size();
    if (law_->uses_displacement()) transform(tile).to_time(U + at, u_.data());
    if (law_->uses_velocity()) {
      multiply(harmonics_, e.s, U + at, velocity_.data(), columns);
      transform(tile).to_time(velocity_.data(), v_.data());
    }
    law_->force(motion(tile, angular_frequency(e)), f_.data(), tile.record);
    mirror(f_, -1, columns);
    transform(tile).to_harmonics(f_.data(), F + at);
  }
}

std::uint64_t Aft::piece() const {
  if (continuous_) return continuous_->piece();
  std::uint64_t sum = 0;
  for (Tile const& tile : tiles_) sum += columns_ ? law_->piece(motion(tile, 1), tile.record) : 0;
  return sum;
}

void Aft::product(double const* dU, double const* dV, double* dF) {
  if (columns_ == 0) return;
  if (continuous_) return continuous_->product(dU, dV, dF);
  for (Tile const& tile : tiles_) {
    const size_t at = size_t(tile.first) * law_->components() * harmonics_.block_size();
    if (law_->uses_displacement()) transform(tile).to_time(dU + at, u_.data());
    if (law_->uses_velocity()) transform(tile).to_time(dV + at, v_.data());
    const contact::Motion motion = this->motion(tile, 1);
    law_->product(motion, tile.record, motion.u, motion.v, f_.data());
    mirror(f_, -1, tile.pairs * law_->components());
    transform(tile).to_harmonics(f_.data(), dF + at);
  }
}

void Aft::gap_product(double const* dgap, double* dF) {
  if (columns_ == 0) return;
  if (continuous_) return continuous_->gap_product(dgap, dF);
  for (Tile const& tile : tiles_) {
    const int d = law_->components(), normal = std::max(law_->normal(), 0);
    const contact::Motion motion = this->motion(tile, 1);
    std::fill_n(u_.data(), motion.size(), 0.0);
    for (int t = 0; t < motion.samples; ++t)
      for (int i = 0; i < tile.pairs; ++i)
        u_[(size_t(t) * d + normal) * tile.pairs + i] = -dgap[tile.first + i];
    law_->product(motion, tile.record, motion.u, nullptr, f_.data());
    transform(tile).to_harmonics(f_.data(), dF + size_t(tile.first) * d * harmonics_.block_size());
  }
}

/// T[pair][row][col] (m x m each): f_n = 2 G_n x_0 + sum_k G_{n-k} x_k + G_{n+k} conj(x_k) for f(t) = g(t)
/// x(t), from the FFT of g alone.
void Aft::toeplitz_hankel(std::vector<double> const& tangent, std::vector<double>& T) const {
  const int m = harmonics_.block_size(), d = law_->components(), columns = d * d * pairs_,
            N = harmonics_.samples();
  std::vector<double> samples(size_t(N) * columns);
  std::copy_n(tangent.data(), size_t(law_samples_) * columns, samples.data());
  mirror(samples, +1, columns);
  complex const* spectrum = tangent_transform_.spectrum(samples.data());
  const double scale = 1.0 / N;
  for (int c = 0; c < columns; ++c) {
    const auto G = [&](int k) {  // periodic in N, conjugate symmetric
      k = ((k % N) + N) % N;
      const complex g = spectrum[size_t(k <= N / 2 ? k : N - k) * columns + c] * scale;
      return k <= N / 2 ? g : std::conj(g);
    };
    const int pair = c % pairs_, row = c / pairs_ / d, col = (c / pairs_) % d;
    double* block = T.data() + ((size_t(pair) * d + row) * m * d + col) * m;
    const size_t ld = size_t(d) * m;
    for (int i = 0; i < harmonics_.count(); ++i)
      for (int j = 0; j < harmonics_.count(); ++j) {
        const int n = harmonics_.orders()[i], k = harmonics_.orders()[j];
        double* b = block + size_t(harmonics_.offset(i)) * ld + harmonics_.offset(j);
        const complex minus = G(n - k), plus = G(n + k);
        if (n && k) {
          b[0] = minus.real() + plus.real(), b[1] = minus.imag() - plus.imag();
          b[ld] = -minus.imag() - plus.imag(), b[ld + 1] = minus.real() - plus.real();
        } else if (n) {
          b[0] = 2 * minus.real(), b[ld] = -2 * minus.imag();
        } else if (k) {
          b[0] = plus.real(), b[1] = -plus.imag();
        } else {
          b[0] = minus.real();
        }
      }
  }
}

/// For a law with memory: the linearised march of a pair for all its coefficients at once, columns innermost.
void Aft::by_columns(double* D) const {
  const int m = harmonics_.block_size(), d = law_->components(), ld = d * m, N = harmonics_.samples(),
            row = d * ld;
  const double one = 1, zero = 0;
  std::vector<double> du(size_t(N) * row), df(du.size());
  for (int t = 0; t < N; ++t)
    for (int c = 0; c < d; ++c)
      std::copy_n(transform_.synthesis().data() + size_t(t) * m, m,
                  du.data() + size_t(t) * row + c * ld + c * m);
  for (Tile const& tile : tiles_)
    for (int i = 0; i < tile.pairs; ++i, D += size_t(ld) * ld) {
      law_->pair_product(motion(tile, 1), tile.record, i, ld, du.data(), df.data());
      for (int c = 0; c < d; ++c)  // rows of component c: analysis^T df, in columns
        dgemm_("N", "T", &ld, &m, &N, &one, df.data() + c * ld, &row, transform_.analysis().data(), &m, &zero,
               D + size_t(c) * m * ld, &ld);
    }
}

void Aft::blocks(Exponents const& e, double* D) {
  if (columns_ == 0) return;
  if (continuous_) return continuous_->blocks(e, D);
  const int m = harmonics_.block_size(), d = law_->components();
  const size_t size = size_t(pairs_) * d * m * d * m;
  if (law_->hereditary()) return by_columns(D);
  std::fill_n(D, size, 0.0);
  std::vector<double> T(size);
  contact::Record const& record = tiles_.front().record;
  if (!record.df_du.empty()) {
    toeplitz_hankel(record.df_du, T);
    std::copy(T.begin(), T.end(), D);
  }
  if (record.df_dv.empty()) return;
  toeplitz_hankel(record.df_dv, T);
  // D += T S: columns of the velocity's block recombined by the 2x2 of s_k
  for (size_t row = 0; row < size_t(pairs_) * d * m; ++row)
    for (int col = 0; col < d; ++col)
      for (int j = 0; j < harmonics_.count(); ++j) {
        const size_t k = (row * d + col) * m + harmonics_.offset(j);
        const double a = e.s[j].real(), b = e.s[j].imag();
        if (harmonics_.orders()[j] == 0) {
          D[k] += a * T[k];
          continue;
        }
        D[k] += a * T[k] - b * T[k + 1];
        D[k + 1] += b * T[k] + a * T[k + 1];
      }
}

}  // namespace fretwave::hb
