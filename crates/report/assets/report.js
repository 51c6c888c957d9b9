/* Adds hover and zoom to the picture; every number it shows is read from the page's own table. */
(function () {
  "use strict";
  var figure = document.querySelector("figure.history");
  var table = document.getElementById("flights");
  if (!figure || !table || !window.uPlot || !figure.querySelector(".still")) return;

  var number = function (text) { return text === "" ? null : Number(text); };
  var time = function (text) { return Date.parse(text.replace(" ", "T") + (text.length > 10 ? "Z" : "T00:00Z")) / 1000; };
  var rows = Array.prototype.map.call(table.tBodies[0].rows, function (row) {
    var cell = function (k) { return row.cells[k].textContent.trim(); };
    return { t: time(cell(0)), when: cell(0), id: cell(1), gap: number(cell(4)), low: number(cell(5)), high: number(cell(6)), remarks: cell(10) };
  });
  var band = Array.prototype.map.call(document.querySelectorAll("#band tbody tr"), function (row) {
    var cell = function (k) { return row.cells[k].textContent.trim(); };
    return { t: time(cell(0)), what: cell(1), mid: number(cell(2)), low: number(cell(3)), high: number(cell(4)) };
  });
  var level = band.filter(function (b) { return b.what === "level"; });
  var fan = band.filter(function (b) { return b.what === "forecast"; });
  var events = Array.prototype.map.call(document.querySelectorAll("#events tbody td:first-child"), function (e) { return time(e.textContent); });
  var limit = number(figure.dataset.limit), watch = number(figure.dataset.watch);
  var dated = function (name) { return figure.dataset[name] ? time(figure.dataset[name]) : null; };
  var earliest = dated("earliest"), likely = dated("likely"), latest = dated("latest");
  var today = fan.length ? fan[0].t : null;
  var first = rows[0].t, last = rows[rows.length - 1].t, span = Math.max(last - first, 864000);
  var far = fan.reduce(function (a, b) { return Math.max(a, b.t); }, last);
  var whole = { min: first - 0.02 * span, max: far + 0.02 * span };
  var colour = function (name) { return getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim(); };

  var live = document.createElement("div");
  live.className = "live";
  var tools = document.createElement("div");
  tools.className = "tools";
  var readout = document.createElement("p");
  readout.className = "readout";
  var rest = "Hover for values, drag to zoom.";
  readout.textContent = rest;
  var range = document.createElement("p");
  range.className = "range";
  var shown = function (u) {
    var day = function (t) { return new Date(t * 1000).toISOString().slice(0, 10); };
    range.textContent = day(u.scales.x.min) + " to " + day(u.scales.x.max);
  };
  figure.insertBefore(live, figure.firstChild);
  figure.insertBefore(tools, live);

  var line = function (u, x0, y0, x1, y1, stroke, dash, width) {
    var c = u.ctx, px = function (x) { return u.valToPos(x, "x", true); }, py = function (y) { return u.valToPos(y, "y", true); };
    c.save();
    c.beginPath();
    c.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    c.clip();
    c.beginPath();
    c.setLineDash(dash);
    c.strokeStyle = stroke;
    c.lineWidth = width * devicePixelRatio;
    c.moveTo(px(x0), py(y0));
    c.lineTo(px(x1), py(y1));
    c.stroke();
    c.restore();
  };
  var label = function (u, text, x, y, align) {
    var c = u.ctx, left = u.valToPos(x, "x", true), gap = 5 * devicePixelRatio;
    c.save();
    c.font = 12 * devicePixelRatio + "px sans-serif";
    c.fillStyle = colour("ink");
    c.textAlign = align;
    c.fillText(text, align === "left" ? left + gap : left - gap, u.valToPos(y, "y", true) - gap);
    c.restore();
  };
  var ribbon = function (u, points, stroke, dash) {
    if (points.length < 2) return;
    var c = u.ctx, px = function (x) { return u.valToPos(x, "x", true); }, py = function (y) { return u.valToPos(y, "y", true); };
    c.save();
    c.beginPath();
    c.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    c.clip();
    c.beginPath();
    points.forEach(function (b) { c.lineTo(px(b.t), py(b.high)); });
    points.slice().reverse().forEach(function (b) { c.lineTo(px(b.t), py(b.low)); });
    c.closePath();
    c.globalAlpha = 0.18;
    c.fillStyle = stroke;
    c.fill();
    c.restore();
    for (var k = 1; k < points.length; k += 1) line(u, points[k - 1].t, points[k - 1].mid, points[k].t, points[k].mid, stroke, dash, 2);
  };
  var draw = function (u) {
    ribbon(u, level, colour("ink"), []);
    ribbon(u, fan, colour("plan"), [6, 4]);
    var y = u.scales.y, x = u.scales.x;
    if (watch !== null) line(u, x.min, watch, x.max, watch, colour("watch"), [], 2);
    if (limit !== null) line(u, x.min, limit, x.max, limit, colour("act"), [], 2);
    if (watch !== null && watch > y.min) label(u, "watch " + watch.toFixed(0) + " µm", x.min, watch, "left");
    if (limit !== null) label(u, "act limit " + limit.toFixed(0) + " µm", x.min, limit, "left");
    if (today !== null && today > x.min && today < x.max) {
      line(u, today, y.min, today, y.max, colour("ink"), [2, 3], 1);
      label(u, "today", today, y.min, "right");
    }
    if (limit !== null && earliest !== null) {
      line(u, earliest, limit, latest === null ? x.max : latest, limit, colour("plan"), [], 6);
      if (likely !== null) line(u, likely, limit - 0.03 * (y.max - y.min), likely, limit + 0.03 * (y.max - y.min), colour("plan"), [], 3);
    }
    events.forEach(function (t) { line(u, t, y.min, t, y.max, colour("plan"), [], 1); });
    rows.forEach(function (r) {
      if (r.gap === null) line(u, r.t, y.min, r.t, y.min + 0.03 * (y.max - y.min), colour("unstated"), [], 2);
      else if (r.low !== null && r.high !== null) line(u, r.t, r.low, r.t, r.high, colour("normal"), [], 1);
    });
  };
  var values = rows.map(function (r) { return r.gap; });
  var ahead = Math.min(fan.reduce(function (a, b) { return Math.max(a, b.high); }, 0), limit === null ? Infinity : 1.15 * limit);
  var top = rows.reduce(function (a, r) { return Math.max(a, r.high || 0, r.gap || 0); }, Math.max(limit || 1, ahead)) * 1.04;
  var lowest = rows.reduce(function (a, r) { return r.gap === null ? a : Math.min(a, r.gap, r.low === null ? r.gap : r.low); }, top);
  var bottom = Math.max(lowest - 0.2 * (top - lowest), Math.min(lowest, 0));
  var show = function (u) {
    var r = u.cursor.idx === null || u.cursor.idx === undefined ? null : rows[u.cursor.idx];
    if (!r) readout.textContent = rest;
    else if (r.gap === null) readout.textContent = r.when + " UTC, " + r.id + ": " + r.remarks;
    else readout.textContent = r.when + " UTC, " + r.id + ": " + r.gap.toFixed(1) + " µm" + (r.low === null ? "" : " (" + r.low.toFixed(1) + " to " + r.high.toFixed(1) + ")");
  };
  var plot = null;
  var make = function () {
    if (plot) plot.destroy();
    var axis = { stroke: colour("ink"), grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid"), width: 1 } };
    plot = new uPlot({
      width: Math.max(live.clientWidth, 240), height: 340, legend: { show: false },
      tzDate: function (t) { return uPlot.tzDate(new Date(t * 1000), "UTC"); },
      scales: { x: { min: whole.min, max: whole.max }, y: { range: [bottom, top] } },
      axes: [Object.assign({ values: [[31536000, "{YYYY}"], [2592000, "{YYYY}-{MM}"], [86400, "{YYYY}-{MM}-{DD}"], [3600, "{HH}:{mm}"]], space: 90 }, axis), Object.assign({ label: "gap µm", size: 56 }, axis)],
      series: [{}, { stroke: colour("normal"), paths: function () { return null; }, points: { show: true, size: 6, fill: colour("normal") } }],
      hooks: { draw: [draw], setCursor: [show], setScale: [shown] }
    }, [rows.map(function (r) { return r.t; }), values], live);
  };
  var button = function (text, range) {
    var b = document.createElement("button");
    b.type = "button";
    b.textContent = text;
    b.addEventListener("click", function () { plot.setScale("x", range()); });
    tools.appendChild(b);
  };
  button("All", function () { return whole; });
  button("Last 90 days", function () { return { min: last - 90 * 86400, max: last + 5 * 86400 }; });
  button("Forecast", function () { return { min: last - 0.05 * span, max: whole.max }; });
  tools.appendChild(range);
  tools.appendChild(readout);
  document.documentElement.classList.add("js");
  make();
  window.addEventListener("resize", function () { plot.setSize({ width: Math.max(live.clientWidth, 240), height: 340 }); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", make);
})();
