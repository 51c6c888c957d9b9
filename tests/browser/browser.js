// A browser that opens reports from disk and remembers everything a page did that it must not do.
import { existsSync, mkdirSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

/** Telephone, tablet, small and large screen, px. */
export const WIDTHS = [390, 768, 1024, 1600];
const DESKTOP = { width: 1280, height: 900 };

const shots = process.env.SHOTS ?? join(import.meta.dirname ?? ".", "shots");
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";

/** Starts the system's browser; there is no sandbox where root runs it, as in a container. */
export async function start() {
  if (!existsSync(executablePath)) throw new Error(`${executablePath} is missing: install chromium`);
  mkdirSync(shots, { recursive: true });
  return chromium.launch({ executablePath, args: process.getuid?.() === 0 ? ["--no-sandbox"] : [] });
}

/** Opens a page; `faults` fills with console errors, failures, dialogs and requests that leave the disk. */
export async function open(browser, file, { viewport = DESKTOP, colorScheme = "light", scripts = true } = {}) {
  const context = await browser.newContext({ viewport, colorScheme, javaScriptEnabled: scripts });
  const page = await context.newPage();
  const faults = [];
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && faults.push(`console: ${m.text()}`));
  page.on("pageerror", (e) => faults.push(`exception: ${e.message}`));
  page.on("dialog", (d) => { faults.push(`dialog: ${d.message()}`); d.dismiss(); });
  page.on("request", (r) => /^(file|data):/.test(r.url()) || faults.push(`request: ${r.url()}`));
  page.on("requestfailed", (r) => {
    const why = r.failure()?.errorText ?? "";
    // What a reader left behind by going on is no fault of the page; a file that is not there is another error.
    if (why !== "net::ERR_ABORTED") faults.push(`failed: ${r.url()} ${why}`);
  });
  await visit(page, file);
  return { page, faults, close: () => context.close() };
}

/** Goes to a page on disk. */
export const visit = (page, file) => page.goto(pathToFileURL(file).href);

/** Keeps a picture of the whole page for people to look at. */
export const shoot = (page, name) => page.screenshot({ path: join(shots, `${name}.png`), fullPage: true });
