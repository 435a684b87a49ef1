#include "model/model.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "fault.h"
#include "model/stuck_basis.h"
#include "together.h"

namespace fretwave::model {

namespace {

void check_term(Term const& term, PetscInt local, PetscInt global) {
  PetscInt rows, cols, local_rows, local_cols;
  check(MatGetSize(term.A, &rows, &cols));
  check(MatGetLocalSize(term.A, &local_rows, &local_cols));
  const std::string letter(1, "KCM"[term.order]);
  if (rows != global || cols != global)
    throw InputError(letter + " does not have the size of the other matrices",
                     std::to_string(rows) + " x " + std::to_string(cols),
                     std::to_string(global) + " x " + std::to_string(global),
                     "give matrices of the same dofs");
  if (local_rows != local || local_cols != local)
    throw InputError(letter + " lies on the ranks in other rows than the other matrices",
                     std::to_string(local_rows) + " rows on this rank", std::to_string(local),
                     "build all matrices with the same row distribution");
}

void check_map(Contact const& contact, Mat B, PetscInt local, PetscInt global) {
  PetscInt rows, cols, local_rows, local_cols;
  check(MatGetSize(B, &rows, &cols));
  check(MatGetLocalSize(B, &local_rows, &local_cols));
  const PetscInt expected = PetscInt(contact.law->components()) * contact.law->pairs();
  if (cols != global || local_cols != local || local_rows != expected)
    throw InputError("contact '" + contact.name + "': B does not fit the model or the law's pairs",
                     std::to_string(local_rows) + " local rows, " + std::to_string(cols) + " columns",
                     std::to_string(expected) + " local rows, " + std::to_string(global) + " columns",
                     "give B one row per pair and component, one column per dof");
}

/// A law that has not been told of another state stands at rest where nothing has moved.
void stand_at_rest(contact::Law& law) {
  if (law.version() == 0) law.rest(std::vector<double>(size_t(law.components()) * law.pairs()).data());
}

}  // namespace

Model::Model(std::vector<Term> terms, std::vector<Contact> contacts, double theta, PetscInt unit)
    : terms_(std::move(terms)), contacts_(std::move(contacts)), unit_(unit), theta_(theta) {
  if (terms_.empty())
    throw InputError("a model needs at least one linear term", "none", "K and M",
                     "give the stiffness and mass matrices");
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(Mat(terms_[0].A)), &comm_));
  check(MatGetSize(terms_[0].A, &global_, nullptr));
  check(MatGetLocalSize(terms_[0].A, &local_, nullptr));
  check(MatGetOwnershipRange(terms_[0].A, &first_, nullptr));
  together(comm_, "checking the model", [this] {
    fault::point("model");
    for (auto const& term : terms_) check_term(term, local_, global_);
    for (auto const& contact : contacts_) {
      check_map(contact, contact.B, local_, global_);
      for (auto const& map : contact.ahead) check_map(contact, map.B, local_, global_);
    }
  });
  together(comm_, "contact at rest", [this] {
    for (auto const& contact : contacts_) stand_at_rest(*contact.law);
  });
}

MatHandle Model::sum(int order) const {
  MatHandle total;
  for (auto const& term : terms_) {
    if (term.order != order || term.phase != 0) continue;
    if (!total)
      check(MatDuplicate(term.A, MAT_COPY_VALUES, total.out()));
    else
      check(MatAXPY(total, 1.0, term.A, UNKNOWN_NONZERO_PATTERN));
  }
  return total;
}

StuckBasis const* Model::stuck_basis() const {
  if (!sought_basis_) stuck_basis_ = StuckBasis::of(*this);
  sought_basis_ = true;
  return stuck_basis_.get();
}

StuckBasis const* Model::whole_stuck_basis() const {
  if (!sought_whole_) whole_basis_ = StuckBasis::of(*this, true);
  sought_whole_ = true;
  return whole_basis_.get();
}

StuckBasis const* Model::static_basis() const {
  if (!sought_static_) static_basis_ = StuckBasis::with_factor(*this);
  sought_static_ = true;
  return static_basis_.get();
}

double Model::largest_term() const {
  double entries = 0;
  for (auto const& term : terms_) {
    MatInfo info;
    check(MatGetInfo(term.A, MAT_GLOBAL_SUM, &info));
    entries = std::max(entries, info.nz_used);
  }
  return entries;
}

VecHandle Model::displacement() const { return make_vector(comm_, local_); }

bool Model::travelling() const {
  const auto turns = [this](auto const& part) { return std::abs(std::sin(part.phase * theta_)) > 1e-12; };
  return std::any_of(terms_.begin(), terms_.end(), turns) ||
         std::any_of(contacts_.begin(), contacts_.end(), [&](Contact const& contact) {
           return std::any_of(contact.ahead.begin(), contact.ahead.end(), turns);
         });
}

bool Model::odd() const {
  int odd = std::all_of(contacts_.begin(), contacts_.end(), [](Contact const& c) { return c.law->odd(); });
  MPI_Allreduce(MPI_IN_PLACE, &odd, 1, MPI_INT, MPI_LAND, comm_);  // a rank sees its own pairs only
  return odd;
}

}  // namespace fretwave::model
