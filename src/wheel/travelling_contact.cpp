#include "wheel/travelling_contact.h"

#include <algorithm>
#include <numbers>

#include "lapack.h"

namespace fretwave::wheel {

TravellingContact::TravellingContact(WheelContact const& contact, Harmonics const& h, int own_sectors,
                                     int wave, MPI_Comm comm)
    : contact_(contact),
      harmonics_(h),
      own_sectors_(own_sectors),
      wave_(wave),
      rows_(contact.rows()),
      comm_(comm),
      shifted_(own_sectors, 1, h.count() * rows_, comm),
      compliances_(own_sectors, h.count(), rows_ * rows_, comm),
      shifted_compliances_(own_sectors, 1, h.count() * rows_ * rows_, comm) {
  first_sector_ = shifted_.first_sector(comm_rank(comm));
}

/// Into the shifted time (-1), or back; `items` per harmonic.
void TravellingContact::turn(std::vector<complex>& x, int items, int sign) const {
  const int N = shifted_.sectors();
  for (int j = 0; j < own_sectors_; ++j)
    for (int i = 0; i < harmonics_.count(); ++i) {
      const size_t turns = size_t(first_sector_ + j) * harmonics_.orders()[i] % N * wave_ % N;
      const complex t = std::polar(1.0, sign * 2 * std::numbers::pi * double(turns) / N);
      complex* at = &x[(size_t(j) * harmonics_.count() + i) * items];
      for (int k = 0; k < items; ++k) at[k] *= t;
    }
}

void TravellingContact::set_compliance(std::vector<complex> const& G) {
  auto sectors = compliances_.to_sectors(G);
  turn(sectors, rows_ * rows_, -1);
  G_ = shifted_compliances_.to_waves(sectors);
}

/// L and M of a group's pairs, mean over the sectors; harmonics x rows squared, row-major.
void TravellingContact::linearise(WheelContact::Group const& group, std::vector<complex>& L,
                                  std::vector<complex>& M) const {
  const int H = harmonics_.count(), R = group.rows, m = harmonics_.block_size(), N = shifted_.sectors();
  const size_t size = size_t(H) * R, ld = size_t(R) * m;
  L.assign(size * size, 0), M.assign(size * size, 0);
  for (int j = 0; j < own_sectors_; ++j) {
    const auto dD = contact_.rest(j, group);
    const auto back = [&](int turns) {
      const double part = double(PetscInt64(first_sector_ + j) * turns % N * wave_ % N) / N;
      return std::polar(1.0 / N, -2 * std::numbers::pi * part);
    };
    for (int i = 0; i < H; ++i)
      for (int k = 0; k < H; ++k) {
        const int n = harmonics_.orders()[i], o = harmonics_.orders()[k];
        const complex linear = back(n - o), conjugate = back(n + o);
        for (int r = 0; r < R; ++r)
          for (int c = 0; c < R; ++c) {
            double const* d = &dD[(size_t(r) * m + harmonics_.offset(i)) * ld + c * m + harmonics_.offset(k)];
            const double cc = d[0], cs = o ? d[1] : 0, sc = n ? d[ld] : 0, ss = n && o ? d[ld + 1] : 0;
            const size_t at = (size_t(i) * R + r) * size + size_t(k) * R + c;
            L[at] += linear * complex(cc + ss, cs - sc) / 2.0;
            M[at] += conjugate * complex(cc - ss, -cs - sc) / 2.0;
          }
      }
  }
  for (auto* A : {&L, &M}) sum_over_ranks(*A, comm_);
}

std::vector<complex> TravellingContact::eliminated(WheelContact::Group const& group, size_t wave,
                                                   size_t mirror, std::vector<complex> const& L,
                                                   std::vector<complex> const& M) const {
  const int H = harmonics_.count(), R = group.rows, half = H * R, size = 2 * half;
  std::vector<complex> E(size_t(size) * size), T(E.size());
  for (int r = 0; r < half; ++r)
    for (int c = 0; c < half; ++c) {
      const complex l = L[size_t(r) * half + c], k = M[size_t(r) * half + c];
      E[size_t(r) * size + c] = l, E[size_t(r) * size + half + c] = k;
      E[size_t(half + r) * size + c] = std::conj(k), E[size_t(half + r) * size + half + c] = std::conj(l);
    }
  for (int part = 0; part < 2; ++part)
    for (int i = 0; i < H; ++i)
      for (int r = 0; r < R; ++r) {
        complex* out = &T[size_t(part * half + i * R + r) * size];
        out[part * half + i * R + r] = 1;
        for (int k = 0; k < R; ++k) {
          const complex g = G_[(((part ? mirror : wave) * H + i) * rows_ + group.first_row + r) * rows_ +
                               group.first_row + k];
          const complex factor = part ? std::conj(g) : g;
          complex const* row = &E[size_t(part * half + i * R + k) * size];
          for (int c = 0; c < size; ++c) out[c] += factor * row[c];
        }
      }
  // column-major sight of row-major E T = Delta is T^T E^T = Delta^T
  if (lapack::solve(T, size, E, size)) std::ranges::fill(E, 0);  // the waves' blocks alone serve this one
  return E;
}

/// A wave's mirror stands behind it, or is the wave itself.
size_t TravellingContact::mirror(size_t wave) const {
  const int N = shifted_.sectors(), d = shifted_.waves()[wave].diameter;
  return d == (N - d) % N ? wave : wave + 1;
}

void TravellingContact::eliminate() {
  E_.clear();
  std::vector<std::vector<complex>> L(contact_.groups().size()), M(L.size());
  for (size_t g = 0; g < L.size(); ++g) linearise(contact_.groups()[g], L[g], M[g]);
  for (size_t w = 0; w < shifted_.waves().size(); w = mirror(w) + 1)
    for (size_t g = 0; g < L.size(); ++g)
      E_.push_back(eliminated(contact_.groups()[g], w, mirror(w), L[g], M[g]));
}

std::vector<complex> TravellingContact::apply(std::vector<complex> u) const {
  const int H = harmonics_.count(), step = 1;
  const complex one = 1, zero = 0;
  turn(u, rows_, -1);
  const auto waves = shifted_.to_waves(u);
  std::vector<complex> f(waves.size()), in, out;
  auto E = E_.begin();
  for (size_t w = 0; w < shifted_.waves().size(); w = mirror(w) + 1)
    for (auto const& group : contact_.groups()) {
      const int half = H * group.rows, size = 2 * half;
      const auto at = [&](size_t wave, int k) {
        return (wave * H + k / group.rows) * rows_ + group.first_row + k % group.rows;
      };
      in.resize(size), out.resize(size);
      for (int k = 0; k < half; ++k)
        in[k] = waves[at(w, k)], in[half + k] = std::conj(waves[at(mirror(w), k)]);
      zgemv_("T", &size, &size, &one, (E++)->data(), &size, in.data(), &step, &zero, out.data(), &step);
      for (int k = 0; k < half; ++k) f[at(mirror(w), k)] = std::conj(out[half + k]), f[at(w, k)] = out[k];
    }
  auto back = shifted_.to_sectors(f);
  turn(back, rows_, +1);
  return back;
}

}  // namespace fretwave::wheel
