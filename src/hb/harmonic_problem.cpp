#include "hb/harmonic_problem.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "error.h"
#include "text.h"

namespace fretwave::hb {

namespace {

/// PETSc counts unknowns in PetscInt.
model::Model const& countable(model::Model const& model, Harmonics const& h) {
  const double unknowns = double(model.dofs()) * h.block_size() + 10;
  if (unknowns > double(PETSC_MAX_INT))
    throw InputError("the harmonic balance has more unknowns than this build of PETSc can count",
                     std::to_string(PetscInt64(unknowns)), "at most " + std::to_string(PETSC_MAX_INT),
                     "reduce the model, retain fewer harmonics, or build PETSc with 64-bit indices");
  return model;
}

}  // namespace

std::string gap_text(double distance) { return "gaps " + short_text(distance) + " wider"; }

HarmonicProblem::HarmonicProblem(model::Model const& model, Harmonics const& h, int scalars, Row row,
                                 double reference_stiffness)
    : residual_(countable(model, h), h),
      at_rest_(residual_),
      scalars_(scalars),
      row_(std::move(row)),
      local_block_(model.local_dofs() * h.block_size()),
      stiffness_(reference_stiffness) {
  if (row_.empty())
    throw InputError("the row to be normalised or observed is zero", "no entry", "one at least",
                     "give a row");
  for (auto const& [dof, weight] : row_)
    if (dof < 0 || dof >= model.dofs())
      throw InputError("the chosen dof does not exist", std::to_string(dof),
                       "0 to " + std::to_string(model.dofs() - 1), "choose a dof of the model");
  q_ = residual_.vector();
  for (auto* v : {&Q_, &dQ_, &R_, &dR_, &excitation_}) *v = like(q_);
  check(VecSet(excitation_, 0));
}

HarmonicProblem::HarmonicProblem(HarmonicProblem const& same, Harmonics const& h)
    : HarmonicProblem(same.model(), h, same.scalars_, same.row_, same.stiffness_) {
  const auto here = [&](Vec x) { return embedded(model(), same.harmonics(), h, x); };
  excitation_ = here(same.excitation_);
  at_rest_.embed_from(same.at_rest_, here);
  unfolding_ = same.unfolding_.embedded(here);
}

VecHandle embedded(model::Model const& model, Harmonics const& from, Harmonics const& to, Vec x) {
  const PetscInt n = model.local_dofs(), before = n * from.block_size(), after = n * to.block_size(),
                 tail = local_size(x) - before;
  VecHandle out = make_vector(model.comm(), after + tail);
  const ReadArray in(x);
  const WriteArray written(out);
  embed(from, in.data(), to, written.data(), int(n));
  std::copy_n(in.data() + before, tail, written.data() + after);
  return out;
}

std::span<std::pair<PetscInt, double> const> HarmonicProblem::mine() const {
  const PetscInt first = model().first_dof(), end = first + model().local_dofs();
  const auto before = [](auto const& entry, PetscInt dof) { return entry.first < dof; };
  return {std::lower_bound(row_.begin(), row_.end(), first, before),
          std::lower_bound(row_.begin(), row_.end(), end, before)};
}

std::vector<double> HarmonicProblem::scalars(Vec y) {
  std::vector<double> z(scalars_ + 2 + unfolding_.count(), 0.0);
  ReadArray in(y);
  if (last_rank()) {
    std::copy_n(in.data() + local_block_, unfolding_.count(), z.begin() + scalars_ + 2);
    std::copy_n(in.data() + local_block_ + unfolding_.count(), scalars_, z.begin());
  }
  if (harmonics().fundamental() >= 0 && !mine().empty()) {
    double* along = z.data() + scalars_;
    along[0] = along[1] = -0.0;  // to which adding x gives x
    for (auto const& [dof, weight] : mine()) {
      const PetscInt place = (dof - model().first_dof()) * harmonics().block_size() +
                             harmonics().offset(harmonics().fundamental());
      for (int j = 0; j < 2; ++j) along[j] += weight * in[place + j];
    }
  }
  MPI_Allreduce(MPI_IN_PLACE, z.data(), int(z.size()), MPI_DOUBLE, MPI_SUM, comm());
  return z;
}

void HarmonicProblem::unpack(Vec y) {
  z_ = scalars(y);
  motion_ = motion(z_);
  residual_.stand_off(motion_.stand_off);
  at_rest_.place(residual_);
  {
    ReadArray in(y);
    std::copy_n(in.data(), local_block_, WriteArray(q_).data());
  }
  check(VecWAXPY(Q_, motion_.amplitude, q_, at_rest_.state()));
}

/// One word of all ranks: where one failed in changing the laws, their versions differ.
bool HarmonicProblem::linearised_at(Vec y) const {
  int same = linearised_in_ == stiffness_ && contact_version_ == residual_.contact_version() &&
             rest_version_ == at_rest_.version() && unfolded_ == unfolding_.count();
  if (same) {
    const ReadArray now(y), last(last_);
    same = std::ranges::equal(now.span(), last.span());
  }
  MPI_Allreduce(MPI_IN_PLACE, &same, 1, MPI_INT, MPI_LAND, comm());
  return same;
}

/// Line searches evaluate elsewhere: the point of linearisation is y, whatever was evaluated last, and the
/// laws are as they are now, whichever problem of the model has changed them.
void HarmonicProblem::linearise(Vec y) {
  if (linearised_at(y)) return;
  linearised_in_ = 0;  // until all of it is done
  unpack(y);
  residual_.evaluate(Q_, motion_.exponents, R_);
  check(VecAXPBYPCZ(R_, -motion_.load, -1, 1, excitation_, at_rest_.load()));
  check(VecScale(R_, 1 / (stiffness_ * motion_.amplitude)));
  if (!last_ || unfolded_ != unfolding_.count()) last_ = unknowns();
  check(VecCopy(y, last_));
  columns_ = std::vector<VecHandle>(scalars_);
  double size;
  check(VecNorm(R_, NORM_2, &size));
  if (std::isfinite(size)) linearised_in_ = stiffness_;  // what came out wrong is tried again
  contact_version_ = residual_.contact_version(), rest_version_ = at_rest_.version();
  unfolded_ = unfolding_.count();
}

void HarmonicProblem::residual(Vec y, Vec r) {
  linearise(y);
  const auto along = unfolding_.components(q_);
  WriteArray out(r);
  ReadArray in(R_);
  std::copy_n(in.data(), local_block_, out.data());
  border(z_, along, out.data());
  if (last_rank() && normalised()) out[local_block_] -= 1;
}

/// Adds the unfolding's force and sets the rows beside the harmonic ones, all of them linear: (w . q, along).
void HarmonicProblem::border(std::vector<double> const& z, std::vector<double> const& along,
                             double* r) const {
  unfolding_.add(z.data() + scalars_ + 2, r);
  if (!last_rank() || !normalised()) return;
  std::copy_n(z.begin() + scalars_, 2, r + local_block_);
  std::copy(along.begin(), along.end(), r + local_block_ + 2);
}

double HarmonicProblem::rounding(Vec y) {
  linearise(y);
  return residual_.rounding() / (stiffness_ * motion_.amplitude);
}

/// Many places are asked after of which nothing else is wanted.
std::uint64_t HarmonicProblem::piece(Vec y, bool finely) {
  if (linearised_at(y)) return residual_.piece(finely);
  linearised_in_ = 0;
  unpack(y);
  return residual_.piece_of(Q_, motion_.exponents, finely);
}

bool HarmonicProblem::measure_in(double k) { return std::exchange(stiffness_, k) != k; }

/// Motion counts relative to its own size, so that a step is a share of it whatever the mesh. The mean of a
/// vibration does not count: what little holds a part in place by friction (a ring in its groove) lets it
/// drift far and turn back wherever a sample changes between stick and slip, while the branch itself goes on.
void HarmonicProblem::metric(Vec y, Vec weights) {
  const PetscInt m = harmonics().block_size();
  const PetscInt mean = harmonics().orders()[0] == 0 && m > 1 ? 1 : 0;
  ReadArray in(y);
  double square = 0;
  for (PetscInt i = 0; i < local_block_; ++i)
    if (i % m >= mean) square += in[i] * in[i];
  MPI_Allreduce(MPI_IN_PLACE, &square, 1, MPI_DOUBLE, MPI_SUM, comm());
  WriteArray out(weights);
  const double weight = square > 0 ? 1 / square : 1;  // no motion at all: the scalars alone measure
  for (PetscInt i = 0; i < local_block_; ++i) out[i] = i % m < mean ? 0 : weight;
  if (!last_rank()) return;
  std::fill_n(out.data() + local_block_, unfolding_.count(), 1.0);
  for (int j = 0; j < scalars_; ++j) out[local_block_ + unfolding_.count() + j] = metric_weight(j);
}

VecHandle HarmonicProblem::pack(Vec q, std::vector<double> const& z) const {
  VecHandle y = unknowns();
  WriteArray out(y);
  ReadArray in(q);
  std::copy_n(in.data(), local_block_, out.data());
  if (!last_rank()) return y;
  std::fill_n(out.data() + local_block_, unfolding_.count(), 0.0);
  std::copy_n(z.begin(), scalars_, out.data() + local_block_ + unfolding_.count());
  return y;
}

VecHandle HarmonicProblem::coefficients(Vec y) {
  at_rest_.place(residual_);  // whoever asks for the motion asks the laws next
  VecHandle Q = residual_.vector();
  const auto m = motion(scalars(y));
  ReadArray in(y), rest(at_rest_.state());
  WriteArray out(Q);
  for (PetscInt i = 0; i < local_block_; ++i) out[i] = rest[i] + m.amplitude * in[i];
  return Q;
}

}  // namespace fretwave::hb
