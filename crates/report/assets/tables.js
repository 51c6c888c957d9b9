/* Sorts tables by a click on a heading, and filters long ones by a word. Without scripts the tables stay as they are. */
(function () {
  "use strict";
  var LONG = 8;
  var body = function (table) { return Array.prototype.slice.call(table.querySelectorAll("tbody tr:not(.group)")); };
  var key = function (row, column) {
    var cell = row.cells[column];
    if (!cell) return "";
    var text = cell.dataset.sort === undefined ? cell.textContent.trim() : cell.dataset.sort;
    var number = Number(text.replace(/[\s\u202f]/g, "").replace(/%$/, ""));
    return text === "" || isNaN(number) ? text.toLowerCase() : number;
  };
  var compare = function (a, b) {
    if (a === "" || b === "") return a === b ? 0 : a === "" ? 1 : -1;
    if (typeof a === typeof b) return a < b ? -1 : a > b ? 1 : 0;
    return typeof a === "number" ? -1 : 1;
  };
  var sort = function (table, column, down) {
    var rows = body(table).map(function (row, at) { return { row: row, at: at, key: key(row, column) }; });
    rows.sort(function (a, b) {
      var order = compare(a.key, b.key);
      // A missing value is last either way.
      return (down && a.key !== "" && b.key !== "" ? -order : order) || a.at - b.at;
    });
    var target = table.tBodies[0];
    Array.prototype.forEach.call(table.querySelectorAll("tr.group"), function (row) { row.remove(); });
    rows.forEach(function (entry) { target.appendChild(entry.row); });
    Array.prototype.slice.call(table.tBodies, 1).forEach(function (empty) { empty.remove(); });
  };
  var heading = function (table, th, column) {
    var button = document.createElement("button");
    button.type = "button";
    button.className = "sort";
    button.textContent = th.textContent;
    button.title = "Sort by " + th.textContent;
    th.textContent = "";
    th.appendChild(button);
    button.addEventListener("click", function () {
      var down = th.getAttribute("aria-sort") === "ascending";
      Array.prototype.forEach.call(th.parentNode.cells, function (other) { other.removeAttribute("aria-sort"); });
      th.setAttribute("aria-sort", down ? "descending" : "ascending");
      sort(table, column, down);
    });
  };
  var filter = function (table) {
    var holder = table.closest(".scroll") || table, label = document.createElement("label"), input = document.createElement("input");
    label.className = "filter";
    label.textContent = "Filter ";
    input.type = "search";
    input.placeholder = "tail, serial, state, …";
    label.appendChild(input);
    holder.parentNode.insertBefore(label, holder);
    input.addEventListener("input", function () {
      var words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
      body(table).forEach(function (row) {
        var text = row.textContent.toLowerCase();
        row.hidden = !words.every(function (word) { return text.indexOf(word) >= 0; });
      });
      Array.prototype.forEach.call(table.querySelectorAll("tr.group"), function (row) { row.hidden = words.length > 0; });
    });
  };
  Array.prototype.forEach.call(document.querySelectorAll("table"), function (table) {
    // The chart reads its values from these two.
    if (!table.tHead || table.id === "flights" || table.id === "band") return;
    var rows = body(table);
    if (rows.length < 2) return;
    Array.prototype.forEach.call(table.tHead.rows[0].cells, function (th, column) { heading(table, th, column); });
    if (rows.length >= LONG && !table.classList.contains("bars")) filter(table);
  });
})();
