#include "hb/slider_derivative.h"

#include <algorithm>
#include <cmath>

#include "contact/vectorise.h"

namespace fretwave::hb {

namespace {

constexpr int stages = Radau::stages;

/// row += a.du + b dR, or their rates.
FRETWAVE_INLINE void add(double* row, std::vector<double> const& wave, double const* a, double b) {
  const size_t m = wave.size();
  double *normal = row, *first = row + m, *second = first + m;
#pragma omp simd
  for (size_t k = 0; k < m; ++k)
    normal[k] += b * wave[k], first[k] += a[0] * wave[k], second[k] += a[1] * wave[k];
}

}  // namespace

void SliderDerivative::add_value(double* row, double const* a, double b) const {
  add(row, wave_, a, b * reach_);
  row[3 * m_] -= b * reach_;
}

void SliderDerivative::add_rate(double* row, double const* a, double b) const {
  add(row, rate_, a, b * reach_);
}

void SliderDerivative::set_time(double tau) {
  if (!harmonics_) return;
  waves(*harmonics_, tau, wave_.data());
  rates(*harmonics_, wave_.data(), rate_.data());
}

/// The same at a node of the grid, which has them.
void SliderDerivative::set_node(PanelGrid const& grid, int node) {
  std::copy_n(&grid.waves()[size_t(node) * m_], m_, wave_.begin());
  std::copy_n(&grid.rates()[size_t(node) * m_], m_, rate_.begin());
}

/// dphi at a slip's begin: from stick the arm's part across e; closing, where R phi' = u'.e' has one solution
/// that is regular, R' phi' = u''.e' - |u'| phi'; behind u, of its direction alone.
void SliderDerivative::begin_slip(SweptSlider::Slip const& slip, MovingDisc const& disc) {
  using Start = SweptSlider::Start;
  if (slip.start == Start::follows && !slip.onset) return;
  const int n = columns();
  const double across[2] = {-slip.e[1], slip.e[0]};
  set_time(slip.begin);
  dphi_.assign(n, 0.0);
  const auto [x, y, r] = disc.jets(slip.begin);
  if (slip.start == Start::follows || slip.start == Start::given) {
    add_value(dphi_.data(), across, 0);
    for (int c = 0; c < n; ++c) dphi_[c] = (dphi_[c] - across[0] * dw_[c] - across[1] * dw_[n + c]) / r.d[0];
    return;
  }
  const double speed = std::hypot(x.d[1], y.d[1]);
  add_rate(dphi_.data(), across, 0);
  if (slip.start == Start::closes) {
    const double turn = (x.d[2] * across[0] + y.d[2] * across[1]) / (r.d[1] + speed), none[2] = {0, 0};
    add_value(dphi_.data(), none, -turn);
  }
  for (double& value : dphi_) value /= speed;
}

FRETWAVE_VECTORISE void SliderDerivative::slip(SweptSlider::Slip const& slip, MovingDisc const& disc,
                                               bool ends) {
  Radau const& method = radau();
  const int n = columns(), first = m_ ? disc.grid->first_node(slip.begin, slip.length) : -1;
  const double h = slip.length, across0[2] = {-slip.e[1], slip.e[0]};
  begin_slip(slip, disc);
  std::array<Radau::Stages, stages> A;
  dp_.assign(size_t(stages) * n, 0.0), dR_.assign(dp_.size(), 0.0);
  const double none[2] = {0, 0};
  for (int j = 0; j < stages; ++j) {
    MovingDisc::Instant const& at = slip.at[j];
    const double R = std::max(at.R, 0.0), p = slip.p[j];
    const double along = h * (at.v[0] * slip.e[0] + at.v[1] * slip.e[1]);
    const double across = h * (at.v[0] * across0[0] + at.v[1] * across0[1]);
    double rate = 0;
    for (int i = 0; i < stages; ++i) rate += method.derivative[j][i] * slip.p[i];
    for (int i = 0; i < stages; ++i) A[j][i] = R * method.derivative[j][i];
    A[j][j] += along + across * p;
    double *row = &dp_[size_t(j) * n], *radius = &dR_[size_t(j) * n];
    const double half = (1 - p * p) / 2;
    const double by_rate[2] = {h * (half * across0[0] - p * slip.e[0]),
                               h * (half * across0[1] - p * slip.e[1])};
    if (first < 0)
      set_time(slip.begin + method.nodes[j] * h);
    else
      set_node(*disc.grid, first + j);
    const double weight = h * method.weights[j];
    for (int k = 0; k < m_; ++k) weights[size_t(nodes + j) * m_ + k] = weight * wave_[k];
    add(radius, wave_, none, reach_), radius[3 * m_] -= reach_;
    add(row, rate_, by_rate, 0);
    const double by_phi = -half * along - p * across;
    for (int c = 0; c < n; ++c) row[c] += by_phi * dphi_[c] - rate * radius[c];
  }
  if (!solve_stages(A, dp_.data(), n)) std::ranges::fill(dp_, NAN);
  for (int j = 0; j < stages; ++j) {
    double *row = &dp_[size_t(j) * n], *radius = &dR_[size_t(j) * n];
    const double p = slip.p[j], turn = 2 / (1 + p * p);
    for (int c = 0; c < n; ++c) row[c] = dphi_[c] + turn * row[c];
    if (!m_) continue;
    const std::array<double, 2> e = slip.direction(j);
    const double R = std::max(slip.at[j].R, 0.0);
    double* arm = &arms[size_t(nodes + j) * 2 * n];
#pragma omp simd
    for (int c = 0; c < n; ++c) {
      arm[c] = e[0] * radius[c] - R * e[1] * row[c];
      arm[n + c] = e[1] * radius[c] + R * e[0] * row[c];
    }
  }
  if (m_) nodes += stages;
  std::copy_n(&dp_[size_t(stages - 1) * n], n, dphi_.begin());
  if (!ends) return;
  // w = u - R e; the panel's last node is its end
  const std::array<double, 2> e = slip.direction(stages - 1);
  const double R = slip.at[stages - 1].R, unit[2][2] = {{1, 0}, {0, 1}};
  std::ranges::fill(dw_, 0.0);
  for (int c = 0; c < 2; ++c) add_value(&dw_[size_t(c) * n], unit[c], -e[c]);
  for (int c = 0; c < n; ++c) dw_[c] += R * e[1] * dphi_[c], dw_[n + c] -= R * e[0] * dphi_[c];
}

void SliderDerivative::go(SweptSlider const& path, MovingDisc const& disc) {
  const int n = columns();
  sticks.clear(), nodes = 0;
  dw_.assign(2 * size_t(n), 0.0), dphi_.assign(n, 0.0);
  dw_[n - 2] = dw_[2 * n - 1] = 1;
  if (m_) {
    const size_t most = path.slips.size() * stages;
    weights.resize(most * m_), arms.resize(most * 2 * n), sticks.reserve(path.sticks.size());
  }
  for (size_t k = 0; k < path.pieces.size(); ++k) {
    SweptSlider::Piece const& piece = path.pieces[k];
    if (piece.slips) {
      const bool last = k + 1 == path.pieces.size() || !path.pieces[k + 1].slips;
      slip(path.slips[piece.number], disc, last);
      continue;
    }
    SweptSlider::Stick const& stick = path.sticks[piece.number];
    if (stick.start == SweptSlider::Start::closes) {
      // w = u at R = 0, whose time moves by -dR / R'
      const MovingDisc::Instant at = disc.at(stick.begin);
      const double unit[2][2] = {{1, 0}, {0, 1}};
      set_time(stick.begin);
      std::ranges::fill(dw_, 0.0);
      for (int c = 0; c < 2; ++c) add_value(&dw_[size_t(c) * n], unit[c], -at.v[c] / at.dR);
    }
    if (m_) sticks.push_back(dw_);
  }
}

void SliderDerivative::of_start(SweptSlider const& path, MovingDisc const& disc, double (&A)[2][2]) {
  go(path, disc);
  for (int row = 0; row < 2; ++row)
    for (int col = 0; col < 2; ++col) A[row][col] = dw_[size_t(row) * columns() + 1 + col];
}

}  // namespace fretwave::hb
