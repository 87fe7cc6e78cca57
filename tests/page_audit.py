"""What every page must fulfil in a browser: on a phone, in a dark room, for readers who do not see it."""

from pathlib import Path

from browser import SOFTWARE_WEBGL, browser_tab

WIDTHS = (390, 768, 1280)

FAULTS = r"""
(() => {
  const found = [];
  const say = (what, element) => found.push(`${what}: ${element.outerHTML.slice(0, 120)}`);
  const named = (one) =>
    (one.getAttribute("aria-label") ?? one.labels?.[0]?.textContent ?? one.textContent ?? "").trim();
  for (const one of document.querySelectorAll("img")) if ((one.alt ?? "").length < 20) say("alt", one);
  for (const one of document.querySelectorAll("[role=img]")) if (named(one).length < 40) say("label", one);
  for (const one of document.querySelectorAll("button, select, input, video, canvas, [role=region], summary"))
    if (!named(one)) say("name", one);
  for (const one of document.querySelectorAll("table")) {
    if (!one.caption?.textContent.trim()) say("caption", one);
    for (const head of one.querySelectorAll("th")) if (!head.scope) say("scope", head);
    for (const row of one.tBodies[0].rows) if (row.cells[0].tagName !== "TH") say("row's head", row);
  }
  const ids = [...document.querySelectorAll("[id]")].map((one) => one.id);
  for (const id of ids.filter((id, n) => ids.indexOf(id) !== n)) found.push(`id twice: ${id}`);
  if (document.querySelectorAll("h1").length !== 1 || !document.documentElement.lang || !document.title)
    found.push("h1, lang, title");

  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const rgba = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = "#0000";
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  const light = ([r, g, b]) => 0.2126 * linear(r / 255) + 0.7152 * linear(g / 255) + 0.0722 * linear(b / 255);
  const contrast = (a, b) => {
    const [x, y] = [light(a), light(b)];
    return (Math.max(x, y) + 0.05) / (Math.min(x, y) + 0.05);
  };
  const over = (top, under) => top.slice(0, 3).map((v, n) => v * top[3] + under[n] * (1 - top[3]));
  const ground = (element) => {
    for (let one = element; one; one = one.parentElement) {
      const colour = rgba(getComputedStyle(one).backgroundColor);
      if (colour[3] === 1) return colour;
    }
    return [255, 255, 255, 1];
  };
  const check = (colour, under, element) => {
    const ratio = contrast(over(rgba(colour), under), under);
    if (ratio < 4.49) say(`contrast ${ratio.toFixed(2)}`, element);
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || !element.getClientRects().length) continue;
    if (element.closest("script, style, noscript, .player .stage, option")) continue;
    const style = getComputedStyle(element);
    check(element.closest("svg") ? style.fill : style.color, ground(element), element);
  }
  for (const one of document.querySelectorAll("svg [data-series] path, svg [data-series] use")) {
    const style = getComputedStyle(one);
    if (one.closest("defs") || !one.getClientRects().length) continue;
    if (style.fillOpacity < 1 || style.opacity < 1) continue;  // a shade
    const paper = ground(one);
    for (const colour of [style.stroke, style.fill])  // what is as the paper is an edge or a hollow mark
      if (!/none|url/.test(colour) && contrast(rgba(colour), paper) > 1.05) check(colour, paper, one);
  }
  return [...new Set(found)];
})()
"""

OUTSIDE = """
[...document.querySelectorAll("body *")].filter((one) => !one.closest(".scroll, .aside, pre, svg") &&
  one.getBoundingClientRect().right > innerWidth + 1).map((one) => one.outerHTML.slice(0, 120))
"""


def faults_of(page: Path) -> list[str]:
    """What is wrong with a page in a browser, at three widths, light and dark; nothing where all is well."""
    found = []
    with browser_tab(*SOFTWARE_WEBGL) as tab:
        for theme in ("light", "dark"):
            for width in WIDTHS:
                tab.opened(page, width, 900, prefers_color_scheme=theme)
                wide = tab.value("document.documentElement.scrollWidth")
                here = [*tab.messages, *tab.value(FAULTS), *tab.value(OUTSIDE)]
                here += [f"{wide} pixels wide"] if wide > width else []
                found += [f"{theme}, {width} pixels: {one}" for one in here]
                tab.messages.clear()
    return found
