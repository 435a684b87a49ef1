#include "casters.h"
#include "contact/registry.h"

namespace fretwave::python {

namespace {

/// A law written in Python, for prototypes: calls object._evaluate(u, v) -> (f, df_du, df_dv) with arrays
/// (samples, components, pairs).
class PythonLaw : public contact::Law {
 public:
  PythonLaw(nb::object law, int pairs) : law_(std::move(law)), pairs_(pairs) {
    components_ = nb::cast<int>(law_.attr("components"));
    odd_ = nb::cast<bool>(law_.attr("odd"));
    stuck_stiffness_ = nb::cast<double>(law_.attr("stuck_stiffness"));
  }
  int components() const override { return components_; }
  int pairs() const override { return pairs_; }
  bool odd() const override { return odd_; }
  double stuck_stiffness(int, int) const override { return stuck_stiffness_; }

  void force(contact::Motion const& motion, double* f, contact::Record& record) const override {
    const std::vector<size_t> shape = {size_t(motion.samples), size_t(motion.components),
                                       size_t(motion.pairs)};
    nb::tuple out =
        nb::cast<nb::tuple>(law_.attr("_evaluate")(numpy_copy(motion.u, shape), numpy_copy(motion.v, shape)));
    const auto take = [&](nb::handle from, size_t size, double* to) {
      auto array = nb::cast<nb::ndarray<double const, nb::c_contig, nb::device::cpu>>(from);
      if (array.size() != size) throw nb::value_error("a law in Python returned an array of the wrong size");
      std::copy_n(array.data(), size, to);
    };
    take(out[0], motion.size(), f);
    record.df_du.resize(motion.size() * motion.components);
    record.df_dv.resize(motion.size() * motion.components);
    take(out[1], record.df_du.size(), record.df_du.data());
    take(out[2], record.df_dv.size(), record.df_dv.data());
  }

  void diagnose(contact::Motion const& motion, double const* f, contact::Diagnosis& out) const override {
    contact::add_work(motion, f, out.work);
    std::fill(out.status.begin(), out.status.end(), contact::Status::slip);
  }

 private:
  nb::object law_;
  int pairs_, components_;
  bool odd_;
  double stuck_stiffness_;
};

nb::list law_table() {
  nb::list out;
  for (auto const& entry : contact::laws()) {
    nb::list parameters;
    contact::Parameters one;
    for (auto const& p : entry.parameters) one[p.name] = {1.0};
    for (auto const& p : entry.parameters)
      parameters.append(nb::make_tuple(p.name, p.unit, p.doc, p.lower, p.strict,
                                       p.standard ? nb::object(nb::cast(*p.standard)) : nb::none()));
    out.append(
        nb::make_tuple(entry.name, entry.doc, entry.components, parameters, entry.make(one)->hereditary()));
  }
  return out;
}

}  // namespace

void bind_contact(nb::module_& m) {
  nb::class_<contact::Law>(m, "Law")
      .def_prop_ro("components", &contact::Law::components)
      .def_prop_ro("odd", &contact::Law::odd)
      .def_prop_ro("pairs", &contact::Law::pairs);
  m.def("law_table", law_table);
  m.def("make_law", [](std::string const& name, contact::Parameters const& p) {
    return std::shared_ptr<contact::Law>(contact::make_law(name, p));
  });
  m.def("python_law", [](nb::object law, int pairs) {
    return std::shared_ptr<contact::Law>(std::make_shared<PythonLaw>(std::move(law), pairs));
  });
}

}  // namespace fretwave::python
