/* The curves over time to hover over and zoom into, in the place of their picture; without scripts it stays. */
(function () {
  "use strict";
  if (!window.uPlot) return;
  var colours = { dx_um: "#9aa5b1", s_um: "#222222", load_kn: "#1c2530" };
  var sync = function (k) { return uPlot.sync("look" + k); };
  Array.prototype.forEach.call(document.querySelectorAll("section"), function (section, k) {
    var data = JSON.parse(section.querySelector("script").textContent);
    var live = section.querySelector(".live"), readout = section.querySelector(".readout");
    var rest = readout.textContent;
    live.hidden = readout.hidden = false;
    section.querySelector(".over-time").classList.add("still");
    var text = function (v, unit, digits) { return v === null || v === undefined ? "missing" : v.toFixed(digits) + " " + unit; };
    var show = function (u) {
      var i = u.cursor.idx;
      readout.textContent = i === null || i === undefined ? rest
        : data.time_s[i].toFixed(2) + " s: δX " + text(data.dx_um[i], "µm", 1) + ", S " + text(data.s_um[i], "µm", 1) + ", load " + text(data.load_kn[i], "kN", 2);
    };
    var bounds = function (u) {
      (data.bounds_um || []).forEach(function (level, n) {
        var y = u.valToPos(level, "y", true), c = u.ctx;
        c.save(); c.beginPath(); c.setLineDash([8, 4]); c.lineWidth = 2 * devicePixelRatio; c.strokeStyle = n ? "#1f6fb2" : "#c85200";
        c.moveTo(u.bbox.left, y); c.lineTo(u.bbox.left + u.bbox.width, y); c.stroke(); c.restore();
      });
    };
    var chart = function (names, height, label, hooks) {
      return new uPlot({
        width: Math.max(live.clientWidth, 260), height: height, legend: { show: false },
        cursor: { sync: { key: sync(k).key, scales: ["x", null] } },
        scales: { x: { time: false } },
        axes: [{ label: "time s" }, { label: label, size: 64, space: 18 }],
        series: [{}].concat(names.map(function (n) { return { stroke: colours[n], width: n === "s_um" ? 2 : 1, points: { show: false } }; })),
        hooks: hooks
      }, [data.time_s].concat(names.map(function (n) { return data[n]; })), live);
    };
    var charts = [chart(["dx_um", "s_um"], 300, "backlash S, δX [µm]", { setCursor: [show], draw: [bounds] }), chart(["load_kn"], 180, "load [kN]", { setCursor: [show] })];
    charts.forEach(function (c) { sync(k).sub(c); });
    window.addEventListener("resize", function () { charts.forEach(function (c) { c.setSize({ width: Math.max(live.clientWidth, 260), height: c.height }); }); });
  });
})();
