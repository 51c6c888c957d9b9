// The report's pages in a real browser: found, read, printed, attacked, and read by a machine.
import assert from "node:assert/strict";
import { existsSync, readFileSync, readdirSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { DESKTOP, PHONE, open, shoot, start, visit } from "./browser.js";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const reports = { sample: process.env.SAMPLE_REPORT, hostile: process.env.HOSTILE_REPORT };
for (const [name, dir] of Object.entries(reports)) assert.ok(dir, `no ${name} report: call tests/browser/run`);
const twin = (name) => JSON.parse(readFileSync(join(reports[name], "report.json"), "utf8"));
const index = (name) => join(reports[name], "index.html");

let browser;
before(async () => { browser = await start(); });
after(() => browser?.close());

/** Opens a page, does something there, and finds nothing that it must not do. */
async function on(file, options, look) {
  const { page, faults, close } = await open(browser, file, options);
  await look(page);
  assert.deepEqual(faults, [], file);
  await close();
}

const um = (m) => { const text = (m * 1e6).toFixed(1); return text === "-0.0" ? "0.0" : text; };
const level = (s) => (s.gap_m === null ? "no data" : `${um(s.gap_m)} ± ${um(1.645 * s.gap_se_m)} µm (90 %)`);
const name = (u) => (u.part_number === null ? u.serial_number : `${u.part_number} / ${u.serial_number}`);
const calls = (u) => ["act", "plan", "unassessed", "watch"].includes(u.statement.state);
// A mark of direction is named in the pages, so that it cannot turn round what stands after it.
const plain = (text) => text.replace("\u202e", "[U+202E]").replace(/\s+/gu, " ").trim();
const all = (page, selector) => page.$$eval(selector, (found) => found.map((e) => e.textContent));
const worst = (page) => page.locator("table.units tbody td:nth-child(2) a").first();

/** The page of a unit, by clicking its name on the front page or on its tail's. */
async function toUnit(page, unit) {
  const here = page.getByRole("link", { name: plain(name(unit)), exact: true });
  if ((await here.count()) > 0) return here.first().click();
  await page.getByRole("table").last().waitFor();
  await page.locator(".map tbody th a", { hasText: unit.tail_number }).first().click();
  return page.getByRole("link", { name: plain(name(unit)), exact: true }).first().click();
}

/** A fact of a serial page, by its name. */
const fact = (page, what) => page.locator(".facts div", { has: page.locator(`dt:text-is("${what}")`) }).locator("dd").textContent();

for (const which of Object.keys(reports)) {
  test(`${which}: every unit is at most two clicks from the front page, and says what the twin says`, async () => {
    const report = twin(which);
    await on(index(which), {}, async (page) => {
      for (const unit of report.units) {
        await visit(page, index(which));
        await toUnit(page, unit);
        assert.equal(plain(await page.locator("h1").textContent()), plain(name(unit)));
        assert.equal(await fact(page, "Gap at the last record"), level(unit.statement));
        assert.equal(await fact(page, "Flights used"), String(unit.quality.estimated));
        const share = Math.round((100 * unit.statement.gap_m) / unit.statement.limit_m);
        assert.equal(await fact(page, "% of limit"), unit.statement.gap_m === null ? "no data" : `${share} %`);
        const over = unit.statement.crossing_hours_p05 !== null && unit.statement.crossing_hours_p05 <= 0;
        const before = over ? "now" : (unit.statement.not_before_utc?.slice(0, 10) ?? "");
        assert.ok((await fact(page, "Earliest (5 %)")).includes(before));
        const gaps = await page.$$eval("#flights tbody tr td:nth-child(5)", (cells) => cells.filter((c) => c.textContent !== "").length);
        assert.equal(gaps, unit.quality.estimated);
      }
    });
  });

  test(`${which}: the front page counts states as the twin does and lists every unit that calls`, async () => {
    const report = twin(which);
    await on(index(which), {}, async (page) => {
      for (const word of ["act", "plan", "unassessed", "watch", "normal", "removed"]) {
        const state = word === "removed" ? null : word;
        const count = report.units.filter((u) => u.statement.state === state).length;
        const card = page.locator(".counts li", { hasText: word });
        assert.equal(await card.locator("b").textContent(), String(count), word);
      }
      const listed = (await all(page, "table.units tbody td:nth-child(2)")).map(plain).sort();
      assert.deepEqual(listed, report.units.filter(calls).map((u) => plain(name(u))).sort());
      const gaps = await all(page, "table.units tbody td:nth-child(4)");
      const expected = report.units.filter(calls).map((u) => level(u.statement));
      assert.deepEqual(gaps.map(plain).sort(), expected.sort());
    });
  });

  test(`${which}: no page breaks a rule of accessibility or overflows, light or dark, wide or narrow`, async () => {
    for (const viewport of [DESKTOP, PHONE]) {
      for (const colorScheme of ["light", "dark"]) {
        const look = `${which}-${viewport.width}-${colorScheme}`;
        const inspect = async (page, shot) => {
          await page.waitForLoadState("load");
          await page.evaluate(axe);
          // Without `preload`: axe would fetch the style sheets once more, which no page opened from disk may.
          const found = await page.evaluate(() => window.axe.run({ preload: false }));
          const broken = found.violations.map((v) => `${v.id}: ${v.nodes.map((n) => n.html).join(" ").slice(0, 300)}`);
          assert.deepEqual(broken, [], `${look} ${shot}`);
          const over = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
          assert.ok(over <= 0, `${look} ${shot} is ${over} px too wide`);
          await shoot(page, `${look}-${shot}`);
        };
        await on(index(which), { viewport, colorScheme }, async (page) => {
          await inspect(page, "fleet");
          await worst(page).click();
          await page.locator("details.twin summary").click();
          await page.locator("#flights").waitFor();
          await inspect(page, "serial-open");
          await page.locator("details.twin summary").click();
          await inspect(page, "serial");
          await page.locator("header nav a").nth(1).click();
          await inspect(page, "tail");
        });
      }
    }
  });

  test(`${which}: every link leads to a page that is there`, async () => {
    const files = readdirSync(reports[which], { recursive: true }).filter((f) => String(f).endsWith(".html"));
    await on(index(which), {}, async (page) => {
      for (const file of files) {
        await visit(page, join(reports[which], String(file)));
        const links = await page.$$eval("a[href], link[rel=stylesheet], script[src]", (found) => found.map((e) => e.href || e.src));
        assert.ok(links.length > 3, String(file));
        for (const link of links) assert.ok(existsSync(fileURLToPath(link.split("#")[0])), `${file}: ${link}`);
      }
    });
  });

  test(`${which}: a heading sorts the work list up and down, and a filter keeps the rows with its words`, async () => {
    await on(index(which), {}, async (page) => {
      const rows = page.locator("table.units tbody tr:not(.group)");
      const count = await rows.count();
      assert.ok(count > 1);
      const shares = async () => page.$$eval("table.units tbody tr:not(.group) td:nth-child(5)", (cells) => cells.map((c) => c.dataset.sort).filter((s) => s !== "").map(Number));
      const button = page.locator("table.units thead button", { hasText: "% of limit" });
      await button.click();
      const up = await shares();
      assert.deepEqual(up, [...up].sort((a, b) => a - b));
      assert.equal(await rows.count(), count, "no row is lost");
      assert.equal(await page.locator("table.units thead th[aria-sort=ascending]").count(), 1);
      await button.click();
      assert.deepEqual(await shares(), [...up].reverse());
      const filter = page.locator(".filter input").first();
      if (await page.locator("#work ~ .filter").count()) {
        const word = plain((await all(page, "table.units tbody tr:not(.group) td:nth-child(2)"))[0]).split(" / ").pop();
        await filter.fill(word);
        const shown = await page.$$eval("table.units tbody tr:not(.group)", (found) => found.filter((r) => !r.hidden).map((r) => r.textContent));
        assert.ok(shown.length >= 1 && shown.every((text) => plain(text).toLowerCase().includes(word.toLowerCase())));
      }
    });
  });

  test(`${which}: on a phone each unit of the work list is a card that shows its action whole`, async () => {
    await on(index(which), { viewport: PHONE }, async (page) => {
      const action = page.locator("table.units tbody td[data-label=Action]").first();
      await action.scrollIntoViewIfNeeded();
      const box = await action.boundingBox();
      assert.ok(box.x >= 0 && box.x + box.width <= PHONE.width, JSON.stringify(box));
      assert.match(await action.textContent(), /^(replace|inspect|none)/);
    });
  });

  test(`${which}: without scripts the pages still answer`, async () => {
    const unit = twin(which).units.find(calls);
    await on(index(which), { scripts: false }, async (page) => {
      await shoot(page, `${which}-without-scripts-fleet`);
      await toUnit(page, unit);
      await page.locator(".still svg").first().waitFor({ state: "visible" });
      assert.equal(await page.locator("canvas").count(), 0);
      assert.ok((await page.locator("main").innerText()).includes(level(unit.statement)));
      await page.locator("details.twin summary").click();
      assert.ok(await page.locator("#flights tbody tr").first().isVisible());
      await shoot(page, `${which}-without-scripts-serial`);
    });
  });

  test(`${which}: pages print`, async () => {
    await on(index(which), {}, async (page) => {
      const sheets = async () => (await page.pdf({ format: "A4" })).toString("latin1").match(/\/Type\s*\/Page\b/g)?.length ?? 0;
      assert.ok((await sheets()) >= 1);
      await worst(page).click();
      assert.ok((await sheets()) >= 1);
      await page.emulateMedia({ media: "print" });
      assert.ok(await page.locator(".still svg").first().isVisible(), "paper has no picture");
      assert.ok(!(await page.locator(".live").isVisible()), "paper shows the live chart");
      await shoot(page, `${which}-print-serial`);
    });
  });
}

test("the picture answers to hover, drag and buttons with values of the table", async () => {
  await on(index("sample"), {}, async (page) => {
    await worst(page).click();
    const plot = page.locator(".live .u-over");
    // The picture may begin below the window.
    await plot.scrollIntoViewIfNeeded();
    const box = await plot.boundingBox();
    const readout = page.locator(".readout");
    const range = page.locator(".range");
    const whole = await range.textContent();
    await page.mouse.move(box.x + box.width * 0.2, box.y + box.height / 2);
    const [, when, gap] = (await readout.textContent()).match(/^(\S+ \S+) UTC, .*: ([\d.]+) µm/) ?? [];
    const rows = await page.$$eval("#flights tbody tr", (found) => found.map((r) => [r.cells[0].textContent, r.cells[4].textContent]));
    assert.ok(rows.some((row) => row[0] === when && row[1] === gap), `${when} ${gap} is no row`);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width * 0.5, box.y + box.height / 2, { steps: 4 });
    await page.mouse.up();
    const near = await range.textContent();
    assert.notEqual(near, whole, "dragging does not zoom");
    await page.getByRole("button", { name: "All" }).focus();
    await page.keyboard.press("Enter");
    assert.equal(await range.textContent(), whole, "the whole is not shown again");
  });
});

test("names that attack are shown, and are not run", async () => {
  const report = twin("hostile");
  const unit = report.units.find((u) => u.serial_number.includes("<img"));
  assert.ok(unit && unit.tail_number.includes("<script>"), "this fleet does not attack");
  const harmless = async (page) => {
    const strangers = await page.$$eval("img, iframe, script:not([src]), [onerror]", (found) => found.map((e) => e.outerHTML));
    assert.deepEqual(strangers, []);
  };
  await on(index("hostile"), {}, async (page) => {
    await harmless(page);
    assert.ok((await page.locator("main").innerText()).includes(unit.tail_number));
    await page.locator(".map tbody th a", { hasText: unit.tail_number }).click();
    await harmless(page);
    assert.equal(await page.title(), `${unit.tail_number} · actuator free play`);
    for (const mate of report.units.filter((u) => u.tail_number === unit.tail_number)) {
      await page.getByRole("link", { name: plain(name(mate)), exact: true }).first().click();
      await harmless(page);
      assert.equal(plain(await page.locator("h1").textContent()), plain(name(mate)));
      await page.goBack();
    }
  });
});

test("how soon pages answer, for people to read", async (t) => {
  for (const which of Object.keys(reports)) {
    await on(index(which), {}, async (page) => {
      const ms = () => page.evaluate(() => performance.getEntriesByType("navigation")[0].domContentLoadedEventEnd.toFixed(0));
      const nodes = () => page.evaluate(() => document.querySelectorAll("*").length);
      t.diagnostic(`${which} fleet page: ${await ms()} ms to DOMContentLoaded, ${await nodes()} elements`);
      await worst(page).click();
      await page.waitForLoadState("load");
      t.diagnostic(`${which} serial page: ${await ms()} ms to DOMContentLoaded, ${await nodes()} elements`);
    });
  }
});
