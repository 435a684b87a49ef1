#include "hb/at_rest.h"

#include "error.h"

namespace fretwave::hb {

AtRest::AtRest(Residual const& residual)
    : harmonics_(residual.harmonics()), state_(residual.vector()), load_(residual.vector()) {
  check(VecSet(state_, 0));
  check(VecSet(load_, 0));
}

void AtRest::set_mean(Vec per_dof, Vec blocks) const {
  const ReadArray in(per_dof);
  const PetscInt n = local_size(per_dof);
  WriteArray out(blocks);
  for (PetscInt i = 0; i < n; ++i) out[i * harmonics_.block_size()] = in[i];
}

void AtRest::preload(Vec x, Vec P) {
  if (harmonics_.orders()[0] != 0)
    throw InputError("a preloaded structure moves about a mean that is not retained",
                     "lowest harmonic " + std::to_string(harmonics_.orders()[0]), "harmonic 0 retained",
                     "retain all harmonics");
  set_mean(x, state_);
  set_mean(P, load_);
  ++version_;
}

void AtRest::keep(AtRest const& other, Vec excitation) {
  sliders_ = other.sliders_, owner_ = other.owner_;
  check(VecCopy(other.state_, state_));
  check(VecWAXPY(load_, 1, excitation, other.load_));
  ++version_;
}

void AtRest::stand(PerContact sliders) {
  static unsigned owners = 0;
  sliders_ = std::move(sliders), owner_ = ++owners;
  ++version_;
}

void AtRest::place(Residual& residual) const {
  if (sliders_) residual.place(*sliders_, owner_);
}

}  // namespace fretwave::hb
