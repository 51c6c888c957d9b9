// The report's pages in a real browser: they agree with report.json, nothing is cut or broken at any width or on paper, names do no
// harm, and no rule of accessibility is violated.
import assert from "node:assert/strict";
import { existsSync, readFileSync, readdirSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { WIDTHS, open, shoot, start, visit } from "./browser.js";

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
const name = (u) => (u.part_number === null ? u.serial_number : `${u.part_number} / ${u.serial_number}`);
const works = (u) => u.statement.action !== null;
// A mark of direction is named in the pages, so that it cannot turn round what stands after it.
const plain = (text) => text.replace("\u202e", "[U+202E]").replace(/\s+/gu, " ").trim();
const all = (page, selector) => page.$$eval(selector, (found) => found.map((e) => e.textContent));
const worst = (page) => page.locator("table.work .what a").first();
const fact = (page, what) => page.locator(".facts div", { has: page.locator(`dt:text-is("${what}")`) }).locator("dd").textContent();
const htmlFiles = (which) => readdirSync(reports[which], { recursive: true }).map(String).filter((f) => f.endsWith(".html"));

/** Elements whose content is wider than they are, and words that lie on two lines. */
const cut = (page) => page.evaluate(() => {
  const visible = [...document.querySelectorAll("body *")].filter((e) => !(e instanceof SVGElement) && e.checkVisibility() && e.clientWidth > 0);
  const wide = visible.filter((e) => e.scrollWidth > e.clientWidth + 1).map((e) => `${e.tagName}.${e.className} ${e.scrollWidth} of ${e.clientWidth} px: ${e.textContent.slice(0, 60)}`);
  const broken = [], nodes = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = nodes.nextNode(); node; node = nodes.nextNode()) {
    if (node.parentElement.closest("script, svg") || !node.parentElement.checkVisibility()) continue;
    for (const word of node.data.matchAll(/[^\s\u00a0]+/gu)) {
      const range = document.createRange();
      range.setStart(node, word.index);
      range.setEnd(node, word.index + word[0].length);
      const lines = new Set([...range.getClientRects()].map((r) => Math.round(r.top)));
      if (lines.size > 1) broken.push(word[0]);
    }
  }
  return { wide, broken };
});

for (const which of Object.keys(reports)) {
  test(`${which}: the front page lists the units with an action, and each page agrees with report.json`, async () => {
    const report = twin(which);
    await on(index(which), {}, async (page) => {
      const listed = (await all(page, "table.work .id")).map(plain).sort();
      assert.deepEqual(listed, report.units.filter(works).map((u) => plain(u.serial_number)).sort());
      const files = new Map();
      for (const file of htmlFiles(which).filter((f) => f.startsWith("serial"))) {
        await visit(page, join(reports[which], file));
        files.set(plain((await page.title()).replace(" · actuator free play", "")), file);
      }
      for (const unit of report.units) {
        const s = unit.statement;
        await visit(page, join(reports[which], files.get(plain(name(unit)))));
        const gap = s.gap_m === null ? "no data" : `${um(s.gap_m)} ± ${um(1.645 * s.gap_se_m)} µm (90 %)`;
        assert.equal(plain(await fact(page, "Gap")), gap);
        assert.ok((await page.locator(".verdict .state").textContent()).endsWith(s.state ?? "removed"));
        const gaps = await page.$$eval("#flights tbody tr td:nth-child(5)", (cells) => cells.filter((c) => c.textContent !== "").length);
        assert.equal(gaps, unit.quality.estimated);
      }
    });
  });

  test(`${which}: nothing is cut or broken and no rule of accessibility is violated, at any width, light or dark`, async () => {
    const seen = new Set();
    for (const width of WIDTHS) {
      for (const colorScheme of ["light", "dark"]) {
        const inspect = async (page, kind) => {
          await page.waitForLoadState("load");
          const look = `${which}-${kind}-${width}-${colorScheme}`;
          await shoot(page, look);
          const { wide, broken } = await cut(page);
          // Names that attack are longer than any screen is wide: they may break, or be scrolled.
          const faults = which === "sample" ? { wide, broken } : { wide: wide.filter((e) => !e.startsWith("DIV.scroll")), broken: [] };
          assert.deepEqual(faults, { wide: [], broken: [] }, look);
          await page.evaluate(axe);
          // Without `preload`: axe would fetch the style sheets once more, which no page opened from disk may.
          const found = await page.evaluate(() => window.axe.run({ preload: false }));
          assert.deepEqual(found.violations.map((v) => `${v.id}: ${v.nodes.map((n) => n.html).join(" ").slice(0, 300)}`), [], look);
          seen.add(kind);
        };
        await on(index(which), { viewport: { width, height: 900 }, colorScheme }, async (page) => {
          await inspect(page, "fleet");
          await worst(page).click();
          await inspect(page, "unit");
          await page.locator("header nav a").nth(1).click();
          await inspect(page, "tail");
          await visit(page, join(reports[which], htmlFiles(which).find((f) => f.startsWith("part"))));
          await inspect(page, "part");
        });
      }
    }
    assert.equal(seen.size, 4);
  });

  test(`${which}: every link leads to a page that is there`, async () => {
    await on(index(which), {}, async (page) => {
      for (const file of htmlFiles(which)) {
        await visit(page, join(reports[which], file));
        const links = await page.$$eval("a[href], link[rel=stylesheet], script[src]", (found) => found.map((e) => e.href || e.src));
        assert.ok(links.length > 2, file);
        for (const link of links) assert.ok(existsSync(fileURLToPath(link.split("#")[0])), `${file}: ${link}`);
      }
    });
  });

  test(`${which}: without scripts the pages still answer`, async () => {
    await on(index(which), { scripts: false }, async (page) => {
      await worst(page).click();
      await page.locator(".still svg").first().waitFor({ state: "visible" });
      assert.equal(await page.locator("figure button").count(), 0);
      await page.locator("details.twin summary").click();
      assert.ok(await page.locator("#flights tbody tr").first().isVisible());
    });
  });
}

test("the first screen and a unit fit on a sheet of A4 each", async () => {
  await on(index("sample"), {}, async (page) => {
    const sheets = async () => (await page.pdf({ preferCSSPageSize: true })).toString("latin1").match(/\/Type\s*\/Page\b/g)?.length ?? 0;
    assert.equal(await sheets(), 1, "fleet");
    for (const file of htmlFiles("sample").filter((f) => f.startsWith("serial"))) {
      await visit(page, join(reports.sample, file));
      assert.equal(await sheets(), 1, file);
    }
    await page.emulateMedia({ media: "print" });
    // A sheet of A4 less its margins, at 96 px per inch.
    await page.setViewportSize({ width: 710, height: 1000 });
    assert.deepEqual(await cut(page), { wide: [], broken: [] });
    assert.ok(await page.locator(".still svg").first().isVisible(), "paper has no chart");
    await shoot(page, "sample-print-unit");
  });
});

test("a point of the chart names its flight and gap, and the chart is magnified and whole again", async () => {
  await on(index("sample"), {}, async (page) => {
    await worst(page).click();
    const points = await all(page, ".still circle title");
    const rows = await page.$$eval("#flights tbody tr", (found) => found.map((r) => [1, 4, 5, 6].map((k) => r.cells[k].textContent)));
    for (const [flight, gap, low, high] of rows) assert.ok(points.some((p) => p.endsWith(`${flight}: ${gap} µm (${low} to ${high})`)), flight);
    const box = () => page.locator(".still svg").first().getAttribute("viewBox");
    const whole = await box();
    await page.getByRole("button", { name: "Magnify newest flights" }).focus();
    await page.keyboard.press("Enter");
    assert.notEqual(await box(), whole, "nothing is magnified");
    await page.locator(".still svg").first().click();
    assert.equal(await box(), whole, "the whole is not shown again");
  });
});

test("names that attack are shown, and are not run", async () => {
  const report = twin("hostile");
  const unit = report.units.find((u) => u.serial_number.includes("<img"));
  assert.ok(unit && unit.tail_number.includes("<script>"), "this fleet does not attack");
  await on(index("hostile"), {}, async (page) => {
    assert.ok((await page.locator("main").innerText()).includes(unit.tail_number));
    for (const file of htmlFiles("hostile")) {
      await visit(page, join(reports.hostile, file));
      const strangers = await page.$$eval("img, iframe, script:not([src]), [onerror]", (found) => found.map((e) => e.outerHTML));
      assert.deepEqual(strangers, [], file);
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
      t.diagnostic(`${which} unit page: ${await ms()} ms to DOMContentLoaded, ${await nodes()} elements`);
    });
  }
});
