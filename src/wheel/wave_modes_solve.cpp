#include "lapack.h"
#include "wheel/wave_modes.h"

/// An application of the inverse.
namespace fretwave::wheel {

using lapack::multiply;

std::vector<scomplex> WaveModes::times(std::vector<scomplex> const& A, complex const* x) const {
  if (rows_ == 0) return {};
  return lapack::product(rows_, rows_, A.data(), std::vector<scomplex>(x, x + rows_));
}

/// g = U^H x and b = Phi Z g.
WaveModes::State WaveModes::relaxed(std::vector<complex> const& x) const {
  const int n = n_, R = rows_, step = 1;
  const complex one = 1, zero = 0;
  State out{std::vector<complex>(x.size()), std::vector<complex>(waves_.size() * R), {}};
  std::vector<scomplex> in, g;
  std::vector<complex> eta(n);
  for (Diameter const& of_d : diameters_) {
    const int columns = int(of_d.waves.size());
    in.clear(), g.resize(size_t(columns) * n);
    for (const size_t w : of_d.waves)
      for (int i = 0; i < n; ++i) in.emplace_back(turned(w, x[w * n + i]));
    multiply("CN", {n, columns, n}, 1.0f, {of_d.basis->U.data(), n}, {in.data(), n}, 0.0f, g.data(), n);
    for (int k = 0; k < columns; ++k) {
      const size_t w = of_d.waves[k];
      for (int l = 0; l < n; ++l) {
        out.g[w * n + l] = g[size_t(k) * n + l];
        eta[l] = of_wave_[w].Z[l] * out.g[w * n + l];
      }
      if (R > 0)
        zgemv_("N", &R, &n, &one, of_d.basis->Phi.data(), &R, eta.data(), &step, &zero, &out.b[w * R], &step);
    }
  }
  return out;
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

/// U eta, eta = Z (g - Phi^H h) but of the families.
std::vector<complex> WaveModes::dofs(State const& state, std::vector<complex> const& f) const {
  const int n = n_, R = rows_, step = 1;
  const complex one = 1, minus = -1;
  std::vector<complex> q(state.g.size()), eta(state.g);
  auto own = state.families.begin();
  for (size_t w = 0; w < waves_.size(); ++w) {
    complex* of_w = &eta[w * n];
    if (R > 0) {
      const auto h = held(w, state, f);
      zgemv_("C", &R, &n, &minus, of_diameter(w).basis->Phi.data(), &R, h.data(), &step, &one, of_w, &step);
    }
    for (int l = 0; l < n; ++l) of_w[l] *= of_wave_[w].Z[l];
    for (size_t k = 0; k < of_wave_[w].family.size() && own != state.families.end(); ++k)
      of_w[of_wave_[w].family[k]] = *own++;
  }
  std::vector<scomplex> in, out;
  for (Diameter const& of_d : diameters_) {
    const int columns = int(of_d.waves.size());
    in.clear(), out.resize(size_t(columns) * n);
    for (const size_t w : of_d.waves) in.insert(in.end(), &eta[w * n], &eta[w * n] + n);
    multiply("NN", {n, columns, n}, 1.0f, {of_d.basis->U.data(), n}, {in.data(), n}, 0.0f, out.data(), n);
    for (int k = 0; k < columns; ++k)
      for (int i = 0; i < n; ++i) q[of_d.waves[k] * n + i] = turned(of_d.waves[k], out[size_t(k) * n + i]);
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
