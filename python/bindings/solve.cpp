#include "casters.h"
#include "solve/continuation.h"

namespace fretwave::python {

namespace {

std::optional<nb::dict> to_python(std::optional<solve::Point> const& p) {
  if (!p) return {};
  nb::dict out;
  out["index"] = p->index, out["y"] = Petsc<Vec>{p->y}, out["tangent"] = Petsc<Vec>{p->tangent};
  out["parameter"] = p->parameter, out["step"] = p->step, out["event"] = p->event, out["wall_s"] = p->wall;
  out["newton"] = p->outcome.newton, out["linear"] = p->outcome.linear, out["residual"] = p->outcome.residual;
  out["rounding"] = p->outcome.rounding, out["accepted"] = int(p->outcome.accepted);
  return out;
}

nb::dict to_python(solve::Fallbacks const& f) {
  nb::dict out;
  out["rebuilt"] = f.rebuilt, out["condensed"] = f.condensed, out["whole"] = f.whole, out["said"] = f.said;
  return out;
}

}  // namespace

void bind_solve(nb::module_& m) {
  using namespace solve;
  nb::class_<Problem>(m, "Problem")
      .def("unknowns", [](Problem& p) { return handed(p.unknowns()); })
      .def("equations", [](Problem& p) { return handed(p.equations()); })
      .def("residual", [](Problem& p, Petsc<Vec> y, Petsc<Vec> r) { p.residual(y.object, r.object); })
      .def("damped", [](Problem& p, Petsc<Vec> y) { return p.damped(y.object); })
      .def("product", [](Problem& p, Petsc<Vec> y, Petsc<Vec> dy,
                         Petsc<Vec> dr) { p.product(y.object, dy.object, dr.object); })
      .def("transposed_product", [](Problem& p, Petsc<Vec> y, Petsc<Vec> dr,
                                    Petsc<Vec> dy) { p.transposed_product(y.object, dr.object, dy.object); })
      .def("jacobian", [](Problem& p, Petsc<Vec> y) { return handed(assemble(p, y.object)); })
      .def("fill_jacobian", [](Problem& p, Petsc<Vec> y, Petsc<Mat> J) { assemble(p, y.object, J.object); })
      .def("metric", [](Problem& p, Petsc<Vec> y, Petsc<Vec> weights) { p.metric(y.object, weights.object); })
      .def("piece", [](Problem& p, Petsc<Vec> y) { return p.piece(y.object); })
      .def("parameter_entry", &Problem::parameter_entry)
      .def("parameter_value", &Problem::parameter_value);
  nb::class_<StepControl>(m, "StepControl")
      .def(nb::init<>())
      .def_rw("initial", &StepControl::initial)
      .def_rw("minimum", &StepControl::minimum)
      .def_rw("maximum", &StepControl::maximum)
      .def_rw("max_angle", &StepControl::max_angle)
      .def_rw("max_error", &StepControl::max_error)
      .def_rw("max_points", &StepControl::max_points);
  nb::class_<Bordered>(m, "Bordered")
      .def("close", [](Bordered& b, Petsc<Vec> row, double value) { b.close(row.object, value); })
      .def("residual", [](Bordered& b, Petsc<Vec> y, Petsc<Vec> g) { b.residual(y.object, g.object); })
      .def("product", [](Bordered& b, Petsc<Vec> y, Petsc<Vec> dy,
                         Petsc<Vec> dg) { b.product(y.object, dy.object, dg.object); })
      .def("transposed_product", [](Bordered& b, Petsc<Vec> y, Petsc<Vec> dg,
                                    Petsc<Vec> dy) { b.transposed_product(y.object, dg.object, dy.object); })
      .def("jacobian", [](Bordered& b, Petsc<Vec> y) {
        MatHandle J = b.matrix();
        b.assemble(y.object, J);
        return handed(J);
      });
  nb::class_<Newton>(m, "Newton")
      .def(nb::init<Problem&, std::string const&, bool>(), nb::keep_alive<1, 2>(), nb::arg(), nb::arg(),
           nb::arg("past_kinks") = true)
      .def_prop_ro("system", &Newton::system, nb::rv_policy::reference_internal)
      .def_prop_ro("route", &Newton::route)
      .def_prop_ro("fallbacks", [](Newton& n) { return to_python(n.fallbacks()); })
      .def_prop_ro("snes", [](Newton& n) { return handed(n.snes()); })
      .def("solve",
           [](Newton& n, Petsc<Vec> y) {
             const Outcome o = n.solve(y.object);
             return nb::make_tuple(o.converged, o.newton, o.linear, o.residual, o.reason);
           })
      .def("linear", [](Newton& n, Petsc<Vec> y, Petsc<Vec> b, Petsc<Vec> x) {
        return n.linear(y.object, b.object, x.object);
      });
  nb::class_<Continuation>(m, "Continuation")
      .def(nb::init<Problem&, std::string const&, double, double, StepControl, std::vector<double>>(),
           nb::keep_alive<1, 2>())
      .def("start",
           [](Continuation& c, Petsc<Vec> y, bool upwards) { return to_python(c.start(y.object, upwards)); })
      .def("restore",
           [](Continuation& c, std::vector<Petsc<Vec>> const& at, std::vector<Petsc<Vec>> const& before,
              double step, int index, bool wary, bool smooth, int emitted, bool upwards, double began) {
             const auto anchor = [&](std::vector<Petsc<Vec>> const& pair) {
               Continuation::Anchor a;
               if (pair.empty()) return a;
               a.y = copy(pair[0].object), a.tangent = copy(pair[1].object);
               a.step = step, a.index = index, a.wary = wary, a.smooth = smooth;
               return a;
             };
             return to_python(c.restore(anchor(at), anchor(before), emitted, upwards, began));
           })
      .def("take_over",
           [](Continuation& c, Petsc<Vec> y, Petsc<Vec> tangent, double step, int index, bool wary,
              std::string const& event, bool upwards, double began) {
             Continuation::Anchor from;
             from.y = copy(y.object), from.tangent = copy(tangent.object);
             from.step = step, from.index = index, from.wary = wary;
             return to_python(c.take_over(std::move(from), event, upwards, began));
           })
      .def("next", [](Continuation& c) { return to_python(c.next()); })
      .def("follow_as_way", &Continuation::follow_as_way)
      .def_prop_ro("ends", &Continuation::ends)
      .def_prop_ro("reason", &Continuation::reason)
      .def_prop_ro("converged", &Continuation::converged)
      .def_prop_ro("route", [](Continuation& c) { return c.newton().route(); })
      .def_prop_ro("fallbacks", [](Continuation& c) { return to_python(c.newton().fallbacks()); })
      .def_prop_ro("snes", [](Continuation& c) { return handed(c.newton().snes()); })
      .def_prop_ro("missed", &Continuation::missed)
      .def("anchor", [](Continuation& c) {
        auto const &a = c.anchor(), &b = c.before();
        nb::dict out;
        out["y"] = Petsc<Vec>{a.y}, out["tangent"] = Petsc<Vec>{a.tangent};
        if (b.y) out["before_y"] = Petsc<Vec>{b.y}, out["before_tangent"] = Petsc<Vec>{b.tangent};
        out["step"] = a.step, out["index"] = a.index, out["wary"] = a.wary, out["smooth"] = a.smooth,
        out["emitted"] = c.emitted();
        out["next_step"] = c.next_step(), out["upwards"] = c.upwards(), out["began"] = c.began();
        return out;
      });
}

}  // namespace fretwave::python
