/* Magnifies the chart of a unit where it is clicked, or at its newest flights by the button. Without scripts the chart stays
   as it is; its values are in the table of flights, and in the texts of its points. */
(function () {
  "use strict";
  var still = document.querySelector("figure.history .still"), svg = still && still.querySelector("svg");
  if (!svg) return;
  var whole = svg.getAttribute("viewBox"), size = svg.viewBox.baseVal, width = size.width, height = size.height, FACTOR = 3;
  var button = document.createElement("button");
  button.type = "button";
  var show = function (x, y) {
    var w = width / FACTOR, h = height / FACTOR, is = x !== null;
    var within = function (at, most) { return Math.max(0, Math.min(most, at)); };
    svg.setAttribute("viewBox", is ? [within(x - w / 2, width - w), within(y - h / 2, height - h), w, h].join(" ") : whole);
    button.textContent = is ? "Whole chart" : "Magnify newest flights";
    still.classList.toggle("near", is);
  };
  var isNear = function () { return still.classList.contains("near"); };
  var newest = function () {
    var dots = svg.querySelectorAll("circle title"), dot = dots.length ? dots[dots.length - 1].parentNode : null;
    return dot ? [Number(dot.getAttribute("cx")), Number(dot.getAttribute("cy"))] : [width / 2, height / 2];
  };
  button.addEventListener("click", function () { if (isNear()) show(null); else show.apply(null, newest()); });
  svg.addEventListener("click", function (event) {
    if (isNear()) return show(null);
    var box = svg.getBoundingClientRect();
    show((event.clientX - box.left) / box.width * width, (event.clientY - box.top) / box.height * height);
  });
  still.parentNode.insertBefore(button, still.nextSibling);
  show(null);
})();
