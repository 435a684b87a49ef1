#include "hb/unfolding.h"

#include "error.h"
#include "text.h"

namespace fretwave::hb {

Unfolding::Unfolding(model::Model const& model, Harmonics const& h, Vec re, Vec im) {
  const MatHandle M = model.sum(2);
  const PetscInt m = h.block_size(), cosine = h.offset(h.fundamental());
  VecHandle Mre = like(re), Mim = like(im);
  check(MatMult(M, re, Mre));
  check(MatMult(M, im, Mim));
  // (tau_c - i tau_s) M phi as (cos, sin); with the same vectors, Re and -Im of phi^H M q_1, which is (cos,
  // sin)
  const ReadArray a(Mre), b(Mim);
  for (int part = 0; part < 2; ++part) {
    VecHandle g = make_vector(model.comm(), model.local_dofs() * m);
    check(VecSet(g, 0));
    {
      WriteArray out(g);
      for (PetscInt i = 0; i < model.local_dofs(); ++i) {
        out[i * m + cosine] = part ? b[i] : a[i];
        out[i * m + cosine + 1] = part ? a[i] : -b[i];
      }
    }
    double length;
    check(VecNormalize(g, &length));
    if (!(length > 0))
      throw InputError("the mode to be avoided has no inertia", short_text(length), "> 0",
                       "give the other mode of the pair");
    vectors_.push_back(std::move(g));
  }
}

std::vector<double> Unfolding::components(Vec q) const {
  std::vector<double> along;
  for (auto const& g : vectors_) {
    along.push_back(0);
    check(VecDot(g, q, &along.back()));
  }
  return along;
}

void Unfolding::add(double const* tau, double* r) const {
  for (size_t j = 0; j < vectors_.size(); ++j) {
    const ReadArray g(vectors_[j]);
    const PetscInt n = local_size(vectors_[j]);
    for (PetscInt i = 0; i < n; ++i) r[i] += tau[j] * g[i];
  }
}

}  // namespace fretwave::hb
