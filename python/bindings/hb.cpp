#include "casters.h"
#include "hb/diagnostics.h"
#include "hb/discretisation_error.h"
#include "hb/forced_response.h"
#include "hb/nonlinear_mode.h"
#include "hb/static_preload.h"

namespace fretwave::python {

namespace {

nb::dict contact_summary(hb::ContactSummary const& s) {
  const double pairs = std::max(1.0, s.stick + s.slip + s.open);
  nb::dict out;
  out["stick"] = s.stick / pairs, out["slip"] = s.slip / pairs, out["open"] = s.open / pairs;
  out["force_outside"] = s.total > 0 ? std::sqrt(s.truncated / s.total) : 0.0;
  out["aliasing"] = s.retained > 0 ? std::sqrt(s.aliased / s.retained) : 0.0;
  out["work"] = s.work, out["unclosed"] = s.unclosed, out["slip_path"] = s.path;
  return out;
}

/// This rank's samples, one (u, v, f, status, gap, work, shares) a contact, the first three samples x
/// components x pairs, the next two samples x pairs; of the period work per pair, shares 3 x pairs.
nb::list contact_periods(hb::HarmonicProblem& problem, Petsc<Vec> y) {
  nb::list out;
  const auto periods = hb::contact_periods(problem, y.object);
  for (size_t k = 0; k < periods.size(); ++k) {
    auto const& law = *problem.model().contacts()[k].law;
    const std::vector<size_t> shape = {size_t(problem.harmonics().samples()), size_t(law.components()),
                                       size_t(law.pairs())};
    const std::vector<size_t> of_pairs = {shape[0], shape[2]};
    out.append(nb::make_tuple(
        numpy_copy(periods[k].u.data(), shape), numpy_copy(periods[k].v.data(), shape),
        numpy_copy(periods[k].f.data(), shape), numpy_bytes(periods[k].status, of_pairs),
        numpy_copy(periods[k].gap.data(), of_pairs), numpy_copy(periods[k].work.data(), {shape[2]}),
        numpy_copy(periods[k].shares.data(), {3, shape[2]})));
  }
  return out;
}

/// (Archard's integrals, mean normal forces, shares of slip and of lift-off) of this rank's pairs, one a
/// contact.
nb::list wearing(hb::HarmonicProblem& problem, Petsc<Vec> y) {
  nb::list out;
  const auto copy = [](std::vector<double> const& v) { return numpy_copy(v.data(), {v.size()}); };
  for (auto const& w : hb::wearing(problem, y.object))
    out.append(nb::make_tuple(copy(w.archard), copy(w.load), copy(w.slip), copy(w.open)));
  return out;
}

nb::dict energy(hb::HarmonicProblem& problem, Petsc<Vec> y) {
  const auto e = hb::energy(problem, y.object);
  nb::dict out;
  out["contact"] = e.contact, out["damping"] = e.damping, out["modal"] = e.modal, out["stored"] = e.stored;
  return out;
}

}  // namespace

void bind_hb(nb::module_& m) {
  using namespace hb;
  nb::class_<Harmonics>(m, "Harmonics")
      .def(nb::init<std::vector<int>, int, int>(), nb::arg(), nb::arg(), nb::arg("moving") = 0)
      .def_prop_ro("orders", &Harmonics::orders)
      .def_prop_ro("samples", &Harmonics::samples)
      .def_prop_ro("block_size", &Harmonics::block_size)
      .def_prop_ro("odd_only", &Harmonics::odd_only);
  nb::class_<HarmonicProblem, solve::Problem>(m, "HarmonicProblem")
      .def("coefficients",
           [](HarmonicProblem& p, Petsc<Vec> y) {
             VecHandle Q = p.coefficients(y.object);
             return handed(Q);
           })
      .def("summary",
           [](HarmonicProblem& p, Petsc<Vec> y) { return contact_summary(summarise(p, y.object)); })
      .def("contact_periods", contact_periods)
      .def("wear", [](HarmonicProblem& p, PerContact const& depth) { p.terms().wear(depth); })
      .def("wearing", wearing)
      .def("gap_product",
           [](HarmonicProblem& p, Petsc<Vec> y, PerContact const& dgap) {
             VecHandle r = gap_product(p, y.object, dgap);
             return handed(r);
           })
      .def("energy", energy)
      .def("mechanical_energy",
           [](HarmonicProblem& p, Petsc<Vec> y) { return mechanical_energy(p, y.object); })
      .def("preload",
           [](HarmonicProblem& p, Petsc<Vec> x, Petsc<Vec> P) { p.at_rest().preload(x.object, P.object); })
      .def("unfold",
           [](HarmonicProblem& p, Petsc<Vec> re, Petsc<Vec> im) {
             p.unfolding() = Unfolding(p.model(), p.harmonics(), re.object, im.object);
           })
      .def("unfolding", [](HarmonicProblem& p, Petsc<Vec> y) { return unfolding_amplitudes(p, y.object); })
      .def_prop_ro("stiffness_scale", &HarmonicProblem::stiffness_scale)
      .def("rounding", [](HarmonicProblem& p, Petsc<Vec> y) { return p.rounding(y.object); })
      .def("scalars", [](HarmonicProblem& p, Petsc<Vec> y) { return p.scalars(y.object); })
      .def(
          "settle",
          [](HarmonicProblem& p, Petsc<Vec> y, PerContact const& from) { settle(p, y.object, from); },
          nb::arg(), nb::arg("sliders") = PerContact{})
      .def("stand", [](HarmonicProblem& p, PerContact const& sliders) { stand(p, sliders); })
      .def(  // the model is kept, not the problem: a branch may go through many
          "on", [](HarmonicProblem const& p, model::Model const&, Harmonics const& h) { return p.on(h); },
          nb::arg("model"), nb::arg("harmonics"), nb::keep_alive<0, 2>())
      .def("embedded",
           [](HarmonicProblem const& p, HarmonicProblem const& other, Petsc<Vec> x) {
             VecHandle out = embedded(p, other, x.object);
             return handed(out);
           })
      .def("exponents", [](HarmonicProblem& p, Petsc<Vec> y) { return p.scaled(y.object).exponents.s; });
  nb::enum_<Method>(m, "Method").value("CNM", Method::CNM).value("EPMC", Method::EPMC);
  nb::class_<NonlinearMode, HarmonicProblem>(m, "NonlinearMode")
      .def(
          "__init__",
          [](NonlinearMode* self, model::Model const& model, Harmonics const& h, Method method, Row row,
             double omega, Petsc<Vec> shape, Petsc<Vec> imaginary) {
            new (self) NonlinearMode(model, h, method, row, omega, shape.object, imaginary.object);
          },
          nb::keep_alive<1, 2>())
      .def("initial", [](NonlinearMode& p, double a) { return handed(p.initial(a)); });
  nb::class_<ModeStart, NonlinearMode>(m, "ModeStart")
      .def(
          "__init__",
          [](ModeStart* self, model::Model const& model, Harmonics const& h, Method method, Row row,
             double omega, Petsc<Vec> shape, Petsc<Vec> imaginary, double amplitude) {
            new (self) ModeStart(model, h, method, row, omega, shape.object, imaginary.object, amplitude);
          },
          nb::keep_alive<1, 2>())
      .def("initial", [](ModeStart& p) { return handed(p.initial()); })
      .def("mode", [](ModeStart& p, Petsc<Vec> y) { return handed(p.mode(y.object)); })
      .def("keep_loads", [](ModeStart& p, HarmonicProblem const& other) { p.keep_loads(other); });
  nb::class_<StaticPreload, HarmonicProblem>(m, "StaticPreload")
      .def(
          "__init__",
          [](StaticPreload* self, model::Model const& model, Petsc<Vec> P, double size, double stiffness) {
            new (self) StaticPreload(model, P.object, size, stiffness);
          },
          nb::keep_alive<1, 2>())
      .def("initial", [](StaticPreload& p) { return handed(p.initial()); });
  nb::class_<ForcedStart, HarmonicProblem>(m, "ForcedStart")
      .def(
          "__init__",
          [](ForcedStart* self, ForcedResponse& to, Petsc<Vec> y, bool gaps) {
            new (self) ForcedStart(to, y.object, gaps ? Way::gaps : Way::excitation);
          },
          nb::keep_alive<1, 2>())
      .def("initial", [](ForcedStart& p) { return handed(p.initial()); })
      .def("response", [](ForcedStart& p, Petsc<Vec> y) { return handed(p.response(y.object)); });
  nb::class_<ForcedResponse, HarmonicProblem>(m, "ForcedResponse")
      .def(
          "__init__",
          [](ForcedResponse* self, model::Model const& model, Harmonics const& h, Row row, Petsc<Vec> P,
             double level, double omega, Petsc<Vec> shape) {
            new (self) ForcedResponse(model, h, row, P.object, level, omega, shape.object);
          },
          nb::keep_alive<1, 2>())
      .def_prop_ro("reference_amplitude", &ForcedResponse::reference_amplitude)
      .def("initial", [](ForcedResponse& p, double omega) { return handed(p.initial(omega)); });
  nb::class_<DiscretisationError>(m, "DiscretisationError")
      .def(nb::init<HarmonicProblem&, std::string const&>(), nb::keep_alive<1, 2>())
      .def_prop_ro("left_out", &DiscretisationError::left_out)
      .def(
          "at",
          [](DiscretisationError& e, Petsc<Vec> y, Petsc<Vec> tangent,
             std::optional<Petsc<Vec>> reduction) -> std::optional<nb::tuple> {
            const auto out = e.at(y.object, tangent.object, reduction ? reduction->object : nullptr);
            if (!out) return {};
            auto const& [harmonics, samples, solver, reduced] = out->by_source;
            return nb::make_tuple(out->all, harmonics, samples, solver, reduced);
          },
          nb::arg("y"), nb::arg("tangent"), nb::arg("reduction").none());
}

}  // namespace fretwave::python
