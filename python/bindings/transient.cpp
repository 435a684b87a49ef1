#include "transient/transient.h"

#include "casters.h"

namespace fretwave::python {

namespace {

Array stack(std::vector<std::vector<double>> const& rows, size_t columns) {
  std::vector<double> flat;
  for (auto const& row : rows) flat.insert(flat.end(), row.begin(), row.end());
  return numpy_copy(flat.data(), {rows.size(), columns});
}

}  // namespace

void bind_transient(nb::module_& m) {
  using transient::Transient;
  nb::class_<Transient>(m, "Transient")
      .def(
          "__init__",
          [](Transient* self, model::Model const& model,
             std::vector<std::tuple<int, Petsc<Vec>, Petsc<Vec>>> const& excitation, double omega,
             std::string const& prefix) {
            std::vector<transient::Excitation> parts;
            for (auto const& [order, cosine, sine] : excitation)
              parts.push_back({order, VecHandle::share(cosine.object), VecHandle::share(sine.object)});
            new (self) Transient(model, std::move(parts), omega, prefix);
          },
          nb::keep_alive<1, 2>())
      .def("run", [](Transient& t, Petsc<Vec> x0, Petsc<Vec> v0, double t_end, double dt_out,
                     double tolerance, double limit, double most_steps) {
        const auto h = t.run(x0.object, v0.object, t_end, dt_out, tolerance, limit, most_steps);
        const size_t n = size_t(local_size(x0.object));
        return nb::make_tuple(numpy_copy(h.t.data(), {h.t.size()}), stack(h.x, n), stack(h.v, n), h.steps,
                              h.implicit, h.finished, h.reason);
      });
}

}  // namespace fretwave::python
