#include "model/model.h"

#include "casters.h"
#include "model/modes.h"

namespace fretwave::python {

void bind_model(nb::module_& m) {
  using model::Model;
  using Terms = std::vector<std::tuple<Petsc<Mat>, int, int>>;
  using Contacts = std::vector<std::tuple<std::string, Petsc<Mat>, std::shared_ptr<contact::Law>>>;
  nb::class_<Model>(m, "Model")
      .def("__init__",
           [](Model* self, Terms const& terms, Contacts const& contacts, double theta) {
             std::vector<model::Term> linear;
             std::vector<model::Contact> groups;
             for (auto const& [A, order, phase] : terms)
               linear.push_back({MatHandle::share(A.object), order, phase});
             for (auto const& [name, B, law] : contacts)
               groups.push_back({name, MatHandle::share(B.object), law});
             new (self) Model(std::move(linear), std::move(groups), theta);
           })
      .def_prop_ro("dofs", &Model::dofs)
      .def_prop_ro("local_dofs", &Model::local_dofs)
      .def_prop_ro("first_dof", &Model::first_dof)
      .def_prop_ro("odd", &Model::odd);
  nb::enum_<model::ContactState>(m, "ContactState")
      .value("stuck", model::ContactState::stuck)
      .value("free", model::ContactState::free)
      .value("linearised", model::ContactState::linearised);
  m.def("linear_modes", [](Model const& mod, int count, model::ContactState state) {
    nb::list out;
    for (auto const& mode : model::linear_modes(mod, count, state))
      out.append(nb::make_tuple(mode.omega, mode.beta, Petsc<Vec>{mode.shape}, Petsc<Vec>{mode.imaginary}));
    return out;
  });
}

}  // namespace fretwave::python
