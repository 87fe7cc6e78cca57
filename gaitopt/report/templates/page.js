// The theme, tables that sort, commands that copy, and print that shows what is folded.
(() => {
  "use strict";
  const make = (tag, text, more = {}) => Object.assign(document.createElement(tag), { textContent: text, ...more });

  const theme = make("button", "", { type: "button", className: "theme" });
  const dark = () => (document.documentElement.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";
  const named = () => { theme.textContent = dark() ? "Light theme" : "Dark theme"; };
  const kept = (value) => {
    try { return value ? localStorage.setItem("theme", value) : localStorage.getItem("theme"); } catch { return null; }
  };
  if (["dark", "light"].includes(kept())) document.documentElement.dataset.theme = kept();
  theme.addEventListener("click", () => { kept(document.documentElement.dataset.theme = dark() ? "light" : "dark"); named(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", named);
  document.querySelector("header").prepend(theme);
  named();

  // A cell's first number; a cell without any comes last.
  const number = (text) => {
    if (text.includes("∞")) return /[-−]\s*∞/.test(text) ? -Infinity : Infinity;
    const found = text.replaceAll("−", "-").match(/[-+]?\d+(\.\d+)?(e[-+]?\d+)?/i);
    return found ? Number(found[0]) : NaN;
  };
  const order = (words, sign) => ([a], [b]) => {
    if (words) return sign * a.localeCompare(b, "en", { numeric: true });
    const [x, y] = [number(a), number(b)];
    if (Number.isNaN(x) || Number.isNaN(y)) return Number.isNaN(x) - Number.isNaN(y);
    return x === y ? 0 : sign * (x < y ? -1 : 1);
  };
  for (const table of document.querySelectorAll("table")) {
    const body = table.tBodies[0];
    if (!body || body.rows.length < 3) continue;
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const button = make("button", "", { type: "button", title: "Sort by this column" });
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const way = head.getAttribute("aria-sort") === "ascending" ? "descending" : "ascending";
        for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", way);
        const rows = [...body.rows].map((row) => [row.cells[column].textContent.trim(), row]);
        const words = rows.every(([text]) => !/^[<>≈±+−-]?\s*[\d∞–]/.test(text));
        rows.sort(order(words, way === "ascending" ? 1 : -1));
        body.append(...rows.map(([, row]) => row));
      });
    });
  }

  for (const line of document.querySelectorAll(".command")) {
    const code = line.querySelector("code");
    const button = make("button", "Copy", { type: "button" });
    button.setAttribute("aria-label", `Copy: ${code.textContent}`);
    button.addEventListener("click", async () => {
      try { await navigator.clipboard.writeText(code.textContent); button.textContent = "Copied"; } catch {
        getSelection().selectAllChildren(code);  // where the browser refuses: Ctrl-C copies what is marked
        button.textContent = "Marked";
      }
      setTimeout(() => { button.textContent = "Copy"; }, 2000);
    });
    line.append(button);
  }

  let closed = [];
  addEventListener("beforeprint", () => {
    closed = [...document.querySelectorAll("details:not([open])")];
    for (const one of closed) one.open = true;
  });
  addEventListener("afterprint", () => { for (const one of closed) one.open = false; });
})();
