// A small plotter: one axis pair as inline SVG, styled by the page through CSS classes. Points that are not finite
// interrupt a curve.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "axis.hpp"
#include "html.hpp"

namespace cfp_slam {

class Plot {
 public:
  static constexpr double usual_left = 52, right = 12, top = 10, bottom = 40;

  // Size of the drawing in units of which the page shows about one per CSS pixel. `title` is for screen readers.
  Plot(const std::string& title, Axis x, Axis y, double width = 480, double height = 270, double left = usual_left)
      : x_(std::move(x)), y_(std::move(y)), width_(width), height_(height), left_(left) {
    out_ = "<svg class=\"plot\" viewBox=\"0 0 " + number(width, 0) + ' ' + number(height, 0) +
           "\" role=\"img\" aria-label=\"" + escape(title) + "\">";
    for (const Tick& tick : x_.marks) {
      line(px(tick.value), top, px(tick.value), height - bottom, "grid-line");
      text(px(tick.value), height - bottom + 15, tick.label, "middle");
    }
    for (const Tick& tick : y_.marks) {
      line(left_, py(tick.value), width - right, py(tick.value), "grid-line");
      text(left_ - 6, py(tick.value) + 4, tick.label, "end");
    }
    text((left_ + width - right) / 2, height - 6, x_.label, "middle");
    const double middle = (top + height - bottom) / 2;
    out_ += "<text transform=\"translate(12 " + number(middle, 1) + ") rotate(-90)\" text-anchor=\"middle\">" +
            escape(y_.label) + "</text>";
  }

  // Both axes in one scale, which the larger extent decides; height as needed, between 200 and 420.
  static Plot equal_scale(const std::string& title, Range x, Range y, const std::string& x_label,
                          const std::string& y_label) {
    for (Range* r : {&x, &y}) {
      if (r->empty) r->add(0);
      const double margin = (std::max)(0.04 * r->size(), 0.005);
      r->low -= margin;
      r->high += margin;
    }
    const double width = 480, inner = width - usual_left - right;
    const double scale = (std::min)(inner / x.size(), (420 - top - bottom) / y.size());
    const double height = (std::max)(200.0, scale * y.size() + top + bottom);
    const auto widen = [](Range& r, double size) {
      const double more = (std::max)(0.0, (size - r.size()) / 2);
      r.low -= more;
      r.high += more;
    };
    widen(x, inner / scale);
    widen(y, (height - top - bottom) / scale);
    return Plot(title, linear_axis(x, x_label), linear_axis(y, y_label, height < 260 ? 4 : 6), width, height);
  }

  [[nodiscard]] double px(double x) const { return left_ + x_.place(x) * (width_ - left_ - right); }
  [[nodiscard]] double py(double y) const { return height_ - bottom - y_.place(y) * (height_ - top - bottom); }

  // Of points nearer than half a unit to the last one drawn in both directions only the first is written.
  void curve(const std::vector<double>& x, const std::vector<double>& y, const std::string& style) {
    std::string path;
    bool pen_down = false;
    double last_x = 0, last_y = 0;
    for (std::size_t i = 0; i < x.size() && i < y.size(); ++i) {
      if (!std::isfinite(x[i]) || !std::isfinite(y[i])) {
        pen_down = false;
        continue;
      }
      const double u = px(x[i]), v = py(y[i]);
      if (pen_down && std::abs(u - last_x) < 0.5 && std::abs(v - last_y) < 0.5) continue;
      path += (pen_down ? 'L' : 'M') + number(u, 1) + ' ' + number(v, 1);
      if (!pen_down) path += "l0 0";  // with round caps a single point is a dot
      pen_down = true;
      last_x = u;
      last_y = v;
    }
    if (!path.empty()) out_ += "<path class=\"" + escape(style) + "\" d=\"" + path + "\"/>";
  }

  // Path text of a box and of a point in the axes' units, clipped to the plot; many of one look make one shape.
  [[nodiscard]] std::string box(double x1, double y1, double x2, double y2) const {
    const double u1 = px(x1), u2 = px(x2), v1 = py(y1), v2 = py(y2);
    return 'M' + number((std::min)(u1, u2), 1) + ' ' + number((std::min)(v1, v2), 1) + 'h' +
           number(std::abs(u2 - u1), 1) + 'v' + number(std::abs(v2 - v1), 1) + 'h' + number(-std::abs(u2 - u1), 1) +
           'z';
  }
  [[nodiscard]] std::string point(double x, double y) const { return 'M' + number(px(x), 1) + ' ' + number(py(y), 1); }

  void shape(const std::string& path, const std::string& style, double opacity = 1) {
    if (path.empty()) return;
    out_ += "<path class=\"" + escape(style) + "\" d=\"" + path + '"' +
            (opacity < 1 ? " fill-opacity=\"" + number(opacity, 2) + '"' : "") + "/>";
  }

  void dot(double x, double y, double radius, const std::string& style, const std::string& hint = {}) {
    if (!std::isfinite(x) || !std::isfinite(y)) return;
    out_ += "<circle class=\"" + escape(style) + "\" cx=\"" + number(px(x), 1) + "\" cy=\"" + number(py(y), 1) +
            "\" r=\"" + number(radius, 1) + "\">" +
            (hint.empty() ? std::string() : "<title>" + escape(hint) + "</title>") + "</circle>";
  }

  // In drawing units.
  void line(double u1, double v1, double u2, double v2, const std::string& style) {
    out_ += "<line class=\"" + escape(style) + "\" x1=\"" + number(u1, 1) + "\" y1=\"" + number(v1, 1) + "\" x2=\"" +
            number(u2, 1) + "\" y2=\"" + number(v2, 1) + "\"/>";
  }
  void text(double u, double v, const std::string& words, const char* anchor, const std::string& style = {}) {
    out_ += "<text" + (style.empty() ? std::string() : " class=\"" + escape(style) + '"') + " x=\"" + number(u, 1) +
            "\" y=\"" + number(v, 1) + "\" text-anchor=\"" + anchor + "\">" + escape(words) + "</text>";
  }

  [[nodiscard]] double width() const { return width_; }
  [[nodiscard]] double height() const { return height_; }
  [[nodiscard]] std::string svg() const {
    return out_ + "<rect class=\"frame\" x=\"" + number(left_, 1) + "\" y=\"" + number(top, 1) + "\" width=\"" +
           number(width_ - left_ - right, 1) + "\" height=\"" + number(height_ - top - bottom, 1) + "\"/></svg>";
  }

 private:
  Axis x_, y_;
  double width_, height_, left_;
  std::string out_;
};

}  // namespace cfp_slam
