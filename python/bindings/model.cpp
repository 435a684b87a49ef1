#include "model/model.h"

#include "casters.h"
#include "model/modes.h"
#include "model/reduction.h"

namespace fretwave::python {

namespace {

/// Column by column in C++, row by row in numpy.
nb::object square(std::vector<double> const& A, size_t n) {
  if (A.empty()) return nb::none();
  return nb::cast(numpy_copy(A.data(), {n, n})).attr("T");
}

std::span<double const> entries(Rows<double> const& rows, PetscInt expected) {
  if (rows.shape(0) != size_t(expected)) throw nb::value_error("an array has the wrong number of rows");
  return {rows.data(), rows.size()};
}

void bind_reduction(nb::module_& m) {
  using model::Reduction;
  nb::class_<Reduction>(m, "Reduction")
      .def("__init__",
           [](Reduction* self, Petsc<Mat> K, Petsc<Mat> M, std::optional<Petsc<Mat>> C,
              std::vector<PetscInt> kept, PetscInt count, double highest_omega) {
             new (self) Reduction(K.object, M.object, C ? C->object : nullptr, std::move(kept),
                                  {count, highest_omega});
           })
      .def_prop_ro("K", [](Reduction const& r) { return square(r.K(), size_t(r.size())); })
      .def_prop_ro("M", [](Reduction const& r) { return square(r.M(), size_t(r.size())); })
      .def_prop_ro("C", [](Reduction const& r) { return square(r.C(), size_t(r.size())); })
      .def_prop_ro("component_omega", &Reduction::component_omega)
      .def_prop_ro("omitted",
                   [](Reduction const& r) {
                     auto const& o = r.omitted();
                     const auto rows = [&](std::vector<double> const& A) {
                       return numpy_copy(A.data(), {A.empty() ? 0 : o.omega.size(), size_t(r.size())});
                     };
                     nb::dict out;
                     out["omega"] = o.omega, out["C"] = o.C;
                     out["M"] = rows(o.M), out["C_from"] = rows(o.from), out["C_onto"] = rows(o.onto);
                     return out;
                   })
      .def_prop_ro("times",
                   [](Reduction const& r) {
                     nb::dict out;
                     out["factorisation"] = r.times().factorisation;
                     out["constraint_modes"] = r.times().constraint_modes;
                     out["component_modes"] = r.times().component_modes;
                     out["projection"] = r.times().projection;
                     return out;
                   })
      .def("expand",
           [](Reduction const& r, Rows<double> x) {
             const auto full = r.expand(entries(x, r.size()), PetscInt(x.shape(1)));
             return numpy_copy(full.data(), {size_t(r.local_dofs()), x.shape(1)});
           })
      .def("project", [](Reduction const& r, Rows<double> f) {
        const auto reduced = r.project(entries(f, r.local_dofs()), PetscInt(f.shape(1)));
        return numpy_copy(reduced.data(), {size_t(r.size()), f.shape(1)});
      });
}

}  // namespace

void bind_model(nb::module_& m) {
  using model::Model;
  using Terms = std::vector<std::tuple<Petsc<Mat>, int, int>>;
  using Maps = std::vector<std::tuple<Petsc<Mat>, int>>;  // B of the own sector first
  using Contacts =
      std::vector<std::tuple<std::string, Maps, std::shared_ptr<contact::Law>, std::vector<int>>>;
  nb::class_<Model>(m, "Model")
      .def(
          "__init__",
          [](Model* self, Terms const& terms, Contacts const& contacts, double theta, PetscInt unit) {
            std::vector<model::Term> linear;
            std::vector<model::Contact> groups;
            for (auto const& [A, order, phase] : terms)
              linear.push_back({MatHandle::share(A.object), order, phase});
            for (auto const& [name, maps, law, numbers] : contacts) {
              groups.push_back({name, MatHandle::share(std::get<0>(maps.at(0)).object), law});
              for (size_t k = 1; k < maps.size(); ++k)
                groups.back().ahead.push_back(
                    {MatHandle::share(std::get<0>(maps[k]).object), std::get<1>(maps[k])});
              groups.back().numbers = numbers;
            }
            new (self) Model(std::move(linear), std::move(groups), theta, unit);
          },
          nb::arg("terms"), nb::arg("contacts"), nb::arg("theta") = 0.0, nb::arg("unit") = 0)
      .def_prop_ro("dofs", &Model::dofs)
      .def_prop_ro("local_dofs", &Model::local_dofs)
      .def_prop_ro("first_dof", &Model::first_dof)
      .def_prop_ro("theta", &Model::theta)
      .def_prop_ro("travelling", &Model::travelling)
      .def_prop_ro("odd", &Model::odd);
  nb::enum_<model::ContactState>(m, "ContactState")
      .value("stuck", model::ContactState::stuck)
      .value("free", model::ContactState::free)
      .value("linearised", model::ContactState::linearised);
  m.def("linear_modes", [](Model const& mod, int count, model::ContactState state, std::optional<double> near,
                           bool stable) {
    nb::list out;
    for (auto const& mode : model::linear_modes(mod, count, state, near, stable))
      out.append(nb::make_tuple(mode.omega, mode.beta, Petsc<Vec>{mode.shape}, Petsc<Vec>{mode.imaginary}));
    return out;
  });
  bind_reduction(m);
}

}  // namespace fretwave::python
