#include "model/phases.h"

#include <cmath>

namespace fretwave::model {

namespace {

MatHandle real_sum(std::vector<PhasedMap> const& parts, double theta) {
  MatHandle total;
  for (auto const& [A, phase] : parts) {
    const double factor = std::cos(phase * theta);
    if (total) {
      check(MatAXPY(total, factor, A, UNKNOWN_NONZERO_PATTERN));
      continue;
    }
    check(MatDuplicate(A, MAT_COPY_VALUES, total.out()));
    check(MatScale(total, factor));
  }
  return total;
}

/// Entries of [[c, s], [-s, c]] a for every entry a, as e^{-i k theta} = c - i s.
struct Triplets {
  std::vector<PetscInt> rows, cols;
  std::vector<double> values;

  void add(Mat A, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    for_entries(A, [&](PetscInt row, PetscInt col, double value) {
      for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) {
          rows.push_back(2 * row + i), cols.push_back(2 * col + j);
          values.push_back(value * (i == j ? c : i < j ? s : -s));
        }
    });
  }
};

MatHandle complex_sum(std::vector<PhasedMap> const& parts, double theta) {
  MPI_Comm comm;
  PetscInt rows, cols;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(Mat(parts[0].B)), &comm));
  check(MatGetLocalSize(parts[0].B, &rows, &cols));
  Triplets entries;
  for (auto const& [A, phase] : parts) entries.add(A, phase * theta);
  MatHandle total;
  check(MatCreate(comm, total.out()));
  check(MatSetSizes(total, 2 * rows, 2 * cols, PETSC_DETERMINE, PETSC_DETERMINE));
  check(MatSetType(total, MATAIJ));
  check(MatSetPreallocationCOO(total, PetscCount(entries.rows.size()), entries.rows.data(),
                               entries.cols.data()));
  check(MatSetValuesCOO(total, entries.values.data(), INSERT_VALUES));
  return total;
}

}  // namespace

MatHandle real_form(std::vector<PhasedMap> const& parts, double theta, bool travelling) {
  if (parts.empty()) return {};
  return travelling ? complex_sum(parts, theta) : real_sum(parts, theta);
}

std::vector<PhasedMap> terms_of(Model const& model, int order) {
  std::vector<PhasedMap> parts;
  for (auto const& term : model.terms())
    if (term.order == order) parts.push_back({MatHandle::share(term.A), term.phase});
  return parts;
}

std::vector<PhasedMap> maps_of(Contact const& contact) {
  std::vector<PhasedMap> maps;
  maps.push_back({MatHandle::share(contact.B), 0});
  for (auto const& map : contact.ahead) maps.push_back({MatHandle::share(map.B), map.phase});
  return maps;
}

}  // namespace fretwave::model
