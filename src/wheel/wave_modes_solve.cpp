#include <numeric>

#include "lapack.h"
#include "log.h"
#include "tuned.h"
#include "wheel/wave_modes.h"

/// An application of the inverse.
namespace fretwave::wheel {

using lapack::multiply;

namespace {

const Tuned faint("wheel_unmoved", 1e-8,
                  "share of a wave in all forces up to which its statics are left out");

}  // namespace

std::vector<scomplex> WaveModes::times(std::vector<scomplex> const& A, complex const* x) const {
  if (rows_ == 0) return {};
  return lapack::product(rows_, rows_, A.data(), std::vector<scomplex>(x, x + rows_));
}

/// g = U^H x and b = Phi Z g + B K_s^-1 x / c.
WaveModes::State WaveModes::relaxed(std::vector<complex> const& x) const {
  const int n = n_, R = rows_, step = 1;
  const complex one = 1, zero = 0;
  State out{
      std::vector<std::vector<complex>>(waves_.size()), std::vector<complex>(waves_.size() * R), {}, {}};
  std::vector<scomplex> in, g;
  for (Diameter const& of_d : diameters_) {
    const int columns = int(of_d.waves.size()), m = modes(of_d);
    std::vector<complex> eta(m);
    in.clear(), g.resize(size_t(columns) * m);
    for (const size_t w : of_d.waves)
      for (int i = 0; i < n; ++i) in.emplace_back(turned(w, x[w * n + i]));
    multiply("CN", {m, columns, n}, 1.0f, {of_d.basis->U.data(), n}, {in.data(), n}, 0.0f, g.data(), m);
    for (int k = 0; k < columns; ++k) {
      const size_t w = of_d.waves[k];
      out.g[w].assign(g.begin() + size_t(k) * m, g.begin() + size_t(k + 1) * m);
      for (int l = 0; l < m; ++l) eta[l] = of_wave_[w].Z[l] * out.g[w][l];
      if (R > 0)
        zgemv_("N", &R, &m, &one, of_d.basis->Phi.data(), &R, eta.data(), &step, &zero, &out.b[w * R], &step);
    }
  }
  move_statically(out, x);
  return out;
}

/// By the factor, of waves that forces are worth it.
void WaveModes::move_statically(State& state, std::vector<complex> const& x) const {
  if (diameters_.empty() || !diameters_[0].basis->factor) return;
  static const log::Event statics("FwStatics");
  const log::Span span(statics);
  const size_t n = size_t(n_);
  std::vector<double> squares(waves_.size(), 0.0);
  for (size_t k = 0; k < x.size(); ++k) squares[k / n] += std::norm(x[k]);
  const double all = std::accumulate(squares.begin(), squares.end(), 0.0);
  std::vector<int> diameters;
  std::vector<complex> columns;
  state.moved.resize(waves_.size());
  std::vector<size_t> taken;
  for (Diameter const& of_d : diameters_)
    for (const size_t w : of_d.waves) {
      if (!(squares[w] > faint * faint * all)) continue;
      taken.push_back(w), diameters.push_back(of_d.d);
      for (size_t i = 0; i < n; ++i) columns.push_back(turned(w, x[w * n + i]));
    }
  diameters_[0].basis->factor->solve(diameters, columns.data());
  for (size_t k = 0; k < taken.size(); ++k) {
    const size_t w = taken[k];
    state.moved[w].assign(columns.begin() + k * n, columns.begin() + (k + 1) * n);
    for (auto const& b : contact_.entries())
      state.b[w * rows_ + b.row] += of_wave_[w].softness * b.value * mean_.turn(b.ahead, diameters[k]) *
                                    state.moved[w][size_t(mean_.place(b.dof))];
  }
}

/// u = b - G X b
std::vector<complex> WaveModes::motions(State const& state) const {
  std::vector<complex> u(state.b.size());
  for (size_t w = 0; w < waves_.size(); ++w) {
    const auto of_w = times(of_wave_[w].motion, &state.b[w * rows_]);
    for (int r = 0; r < rows_; ++r) u[w * rows_ + r] = turned(w, complex(of_w[r]));
  }
  return u;
}

/// h = f + X (b - G f) of a wave: what holds its rows.
std::vector<complex> WaveModes::held(size_t wave, State const& state, std::vector<complex> const& f) const {
  std::vector<complex> h(rows_);
  for (int r = 0; r < rows_; ++r) h[r] = turned(wave, f[wave * rows_ + r]);
  const auto of_f = times(of_wave_[wave].force, h.data()),
             of_b = times(of_wave_[wave].X, &state.b[wave * rows_]);
  for (int r = 0; r < rows_; ++r) h[r] = complex(of_f[r] + of_b[r]);
  return h;
}

/// Adds the families' motion to g, as what moves them, and to b.
void WaveModes::move_families(State& state, std::vector<complex> const& eta) const {
  size_t at = first_member_;
  for (size_t w = 0; w < waves_.size(); ++w)
    for (const int l : of_wave_[w].family) {
      const complex own = turned(w, eta[at++]);
      state.families.push_back(own);
      for (int i = 0; i < rows_; ++i)
        state.b[w * rows_ + i] += of_diameter(w).basis->Phi[size_t(l) * rows_ + i] * own;
    }
}

/// eta = Z (g - Phi^H h), and that of families.
std::vector<complex> WaveModes::modal(size_t w, State const& state, std::vector<complex> const& h,
                                      std::vector<complex>::const_iterator& families) const {
  const int m = int(state.g[w].size()), R = rows_, step = 1;
  const complex one = 1, minus = -1;
  auto eta = state.g[w];
  if (R > 0)
    zgemv_("C", &R, &m, &minus, of_diameter(w).basis->Phi.data(), &R, h.data(), &step, &one, eta.data(),
           &step);
  for (int l = 0; l < m; ++l) eta[l] *= of_wave_[w].Z[l];
  for (size_t k = 0; k < of_wave_[w].family.size() && families != state.families.end(); ++k)
    eta[of_wave_[w].family[k]] += *families++;
  return eta;
}

/// U eta + K_s^-1 (x - B^H h) / c
std::vector<complex> WaveModes::dofs(State const& state, std::vector<complex> const& f) const {
  const int n = n_, R = rows_;
  std::vector<complex> q(waves_.size() * size_t(n));
  std::vector<std::vector<complex>> etas, forces;
  auto families = state.families.begin();
  for (size_t w = 0; w < waves_.size(); ++w) {
    forces.push_back(R > 0 ? held(w, state, f) : std::vector<complex>());
    etas.push_back(modal(w, state, forces[w], families));
  }
  std::vector<scomplex> in, out, h;
  for (Diameter const& of_d : diameters_) {
    const int columns = int(of_d.waves.size()), m = modes(of_d);
    in.clear(), h.clear(), out.resize(size_t(columns) * n);
    for (const size_t w : of_d.waves) {
      in.insert(in.end(), etas[w].begin(), etas[w].end());
      for (complex const& a : forces[w]) h.push_back(scomplex(of_wave_[w].softness * a));
    }
    multiply("NN", {n, columns, m}, 1.0f, {of_d.basis->U.data(), n}, {in.data(), m}, 0.0f, out.data(), n);
    if (of_d.basis->factor)
      multiply("NN", {n, columns, R}, -1.0f, {of_d.basis->static_shapes.data(), n}, {h.data(), R}, 1.0f,
               out.data(), n);
    for (int k = 0; k < columns; ++k) {
      const size_t w = of_d.waves[k];
      const bool moves = !state.moved.empty() && !state.moved[w].empty();
      for (int i = 0; i < n; ++i) {
        complex a = out[size_t(k) * n + i];
        if (moves) a += of_wave_[w].softness * state.moved[w][i];
        q[w * n + i] = turned(w, a);
      }
    }
  }
  return q;
}

std::vector<complex> WaveModes::solve(std::vector<complex> const& x, Forces const& E) const {
  State state = relaxed(x);
  auto u = motions(state);
  if (!apart_) return dofs(state, rows_ > 0 ? E(u) : u);
  const auto r = forces_on_families(state);
  if (inside_pays()) u = coupled(std::move(u), r, E);
  const auto [f, eta] = reply(std::move(u), r, E);
  move_families(state, eta);
  return dofs(state, f);
}

}  // namespace fretwave::wheel
