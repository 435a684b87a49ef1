#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "log.h"
#include "tuned.h"
#include "wheel/wave_modes.h"

/// The families of modes, and the sectors' contact between them.
namespace fretwave::wheel {

namespace {

const Tuned near("wheel_near", 0.3, "dynamic over static stiffness of a mode up to which it is in a family");
const Tuned most("wheel_most", 250, "modes in families, at the most");
const Tuned far("wheel_families_far", 1e-2,
                "relative change of the exponents at which families are chosen anew");
const Tuned tolerance("wheel_tolerance", 0.1, "relative residual of the sectors' coupling", 1);
const Tuned most_inside("wheel_inside", 30, "iterations of the sectors' coupling, at the most");

}  // namespace

/// Modes near the fundamental, the nearest if there are too many. Collective.
void WaveModes::find_family(Exponents const& e) {
  const int first = problem_.harmonics().fundamental();
  if (chosen_at_ != complex() && std::abs(e.s[first] - chosen_at_) < far * std::abs(chosen_at_)) return;
  chosen_at_ = e.s[first];
  struct Found {
    size_t wave;
    int mode;
    double size;
  };
  const auto c = coefficients(e, first);
  std::vector<Found> found;
  std::vector<double> sizes;
  for (size_t w = 0; w < waves_.size(); ++w) {
    of_wave_[w].family.clear();
    Diameter const& of_d = of_diameter(w);
    for (int l = 0; l < modes(of_d) && waves_[w].harmonic == first; ++l) {
      const double size =
          std::abs((c[0] + c[1] * of_d.basis->damping[l] + c[2] * of_d.basis->theta[l]) / c[0]);
      if (size < near) found.push_back({w, l, size}), sizes.push_back(size);
    }
  }
  auto all = gathered(std::span<double const>(sizes), problem_.comm());
  std::ranges::sort(all);
  const double limit = all.size() > size_t(most.count()) ? all[most.count()] : INFINITY;
  std::vector<Families::Member> members;
  std::vector<complex> shapes;
  for (auto const& [w, l, size] : found) {
    if (!(size < limit)) continue;
    of_wave_[w].family.push_back(l);
    members.push_back({waves_[w].harmonic, waves_[w].diameter, l});
    for (int i = 0; i < n_; ++i)
      shapes.push_back(turned(w, complex(of_diameter(w).basis->U[size_t(l) * n_ + i])));
  }
  const int mine = int(members.size());
  const auto counts = gathered(std::span(&mine, 1), problem_.comm());
  first_member_ = std::accumulate(counts.begin(), counts.begin() + comm_rank(problem_.comm()), size_t(0));
  members = gathered(std::span<Families::Member const>(members), problem_.comm());
  if (families_ && families_->members() == members) return;
  shapes = gathered(std::span<complex const>(shapes), problem_.comm());
  families_.reset();
  if (!members.empty()) families_.emplace(problem_, mean_, std::move(members), std::move(shapes));
}

void WaveModes::couple(std::vector<complex> const& local) {
  if (!apart_) return;
  const size_t R = rows_;
  for (size_t w = 0; w < waves_.size(); ++w) {
    complex const *G = &compliances_[w * R * R], *of_sector = &local[size_t(waves_[w].harmonic) * R * R];
    auto& between = of_wave_[w].between;
    between.resize(R * R);
    for (size_t r = 0; r < R; ++r)
      for (size_t c = 0; c < R; ++c) between[c * R + r] = scomplex(G[r * R + c] - of_sector[r * R + c]);
  }
  if (families_) make_families();
}

/// S, what else is read from a wave being that of all its other modes.
void WaveModes::make_families() {
  const int R = rows_, K = families_->size();
  std::vector<complex> S(size_t(K) * K), Psi, Lambda;
  size_t at = first_member_;
  for (size_t w = 0; w < waves_.size(); ++w) {
    OfWave& of_wave = of_wave_[w];
    of_wave.Psi.clear(), of_wave.Lambda.clear();
    const size_t k = of_wave.family.size();
    for (size_t i = 0; i < k; ++i) {
      complex const* Phi = &of_diameter(w).basis->Phi[size_t(of_wave.family[i]) * R];
      const auto motion = times(of_wave.motion, Phi), XPhi = times(of_wave.X, Phi);
      for (int r = 0; r < R; ++r) {
        complex force = 0;
        for (int q = 0; q < R; ++q) force += std::conj(Phi[q]) * complex(of_wave.force[size_t(r) * R + q]);
        of_wave.Psi.push_back(turned(w, complex(motion[r]))), of_wave.Lambda.push_back(turned(w, force));
      }
      for (size_t j = 0; j < k; ++j) {
        complex const* of_row = &of_diameter(w).basis->Phi[size_t(of_wave.family[j]) * R];
        complex sum = i == j ? of_wave.z[of_wave.family[i]] : 0.0;
        for (int r = 0; r < R; ++r) sum += std::conj(of_row[r]) * complex(XPhi[r]);
        S[(at + i) * K + at + j] = turned(w, sum);
      }
    }
    at += k;
    Psi.insert(Psi.end(), of_wave.Psi.begin(), of_wave.Psi.end());
    Lambda.insert(Lambda.end(), of_wave.Lambda.begin(), of_wave.Lambda.end());
  }
  const auto comm = problem_.comm();
  sum_over_ranks(S, comm);
  std::vector<std::vector<complex>> of_harmonics;
  for (int i = 0; i < problem_.harmonics().count(); ++i) of_harmonics.push_back(coefficients(beside_, i));
  families_->make(S, of_harmonics, gathered(std::span<complex const>(Psi), comm),
                  gathered(std::span<complex const>(Lambda), comm), contact_);
}

/// S^-1 (r - Lambda^H f); r is empty for none. Collective.
std::vector<complex> WaveModes::family(std::vector<complex> r, std::vector<complex> const& f) const {
  r.resize(families_->size());
  size_t at = first_member_;
  for (size_t w = 0; w < waves_.size(); ++w)
    for (size_t k = 0; k < of_wave_[w].family.size(); ++k, ++at)
      for (int i = 0; i < rows_; ++i) r[at] -= of_wave_[w].Lambda[k * rows_ + i] * f[w * rows_ + i];
  sum_over_ranks(r, problem_.comm());
  return families_->solve(r);
}

/// f = E (u + Psi eta) of eta = S^-1 (r - Lambda^H E u), what sectors reply that feel each other by the
/// families alone. Collective.
WaveModes::Reply WaveModes::reply(std::vector<complex> u, std::vector<complex> const& r,
                                  Forces const& E) const {
  if (rows_ == 0) return {{}, families_ ? family(r, {}) : r};
  auto f = E(u);
  if (!families_) return {std::move(f), {}};
  auto eta = family(r, f);
  size_t at = first_member_;
  for (size_t w = 0; w < waves_.size(); ++w)
    for (size_t k = 0; k < of_wave_[w].family.size(); ++k, ++at)
      for (int i = 0; i < rows_; ++i) u[w * rows_ + i] += of_wave_[w].Psi[k * rows_ + i] * eta[at];
  return {E(u), std::move(eta)};
}

/// (G - G_j) f
std::vector<complex> WaveModes::between(std::vector<complex> const& f) const {
  std::vector<complex> u;
  for (size_t w = 0; w < waves_.size(); ++w)
    for (const scomplex a : times(of_wave_[w].between, &f[w * rows_])) u.push_back(a);
  return u;
}

namespace {

/// Real and imaginary parts side by side.
std::vector<complex> from_parts(std::span<double const> v) {
  std::vector<complex> x(v.size() / 2);
  for (size_t k = 0; k < x.size(); ++k) x[k] = {v[2 * k], v[2 * k + 1]};
  return x;
}

std::vector<double> to_parts(std::vector<complex> const& x) {
  std::vector<double> v;
  for (complex a : x) v.push_back(a.real()), v.push_back(a.imag());
  return v;
}

}  // namespace

/// u of u + (G - G_j) F(u) = u_0, F the reply of the sectors. Collective.
std::vector<complex> WaveModes::coupled(std::vector<complex> u, std::vector<complex> const& r,
                                        Forces const& E) const {
  static const log::Event coupling("FwSectors");
  const log::Span span(coupling);
  ContactGmres gmres(
      problem_.comm(), 2 * u.size(),
      [&](std::span<double const> in, std::span<double> out) {
        std::ranges::transform(to_parts(between(reply(from_parts(in), {}, E).f)), in, out.begin(),
                               std::plus());
      },
      tolerance, most_inside.count());
  const auto of_none = between(reply(std::vector<complex>(u.size()), r, E).f);
  for (size_t k = 0; k < u.size(); ++k) u[k] -= of_none[k];
  return from_parts(gmres.solve(to_parts(u)));
}

/// g - Phi^H X b of this rank's members.
std::vector<complex> WaveModes::forces_on_families(State const& state) const {
  std::vector<complex> r(families_ ? families_->size() : 0);
  size_t at = first_member_;
  for (size_t w = 0; w < waves_.size(); ++w) {
    const auto Xb = times(of_wave_[w].X, state.b.data() + w * rows_);
    for (const int l : of_wave_[w].family) {
      complex sum = state.g[w][l];
      for (int i = 0; i < rows_; ++i)
        sum -= std::conj(of_diameter(w).basis->Phi[size_t(l) * rows_ + i]) * complex(Xb[i]);
      r[at++] = turned(w, sum);
    }
  }
  return r;
}

}  // namespace fretwave::wheel
