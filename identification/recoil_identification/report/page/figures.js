"use strict";
(async () => {
  const element = (id) => document.getElementById(id);
  const show = (id) => { element(id).style.display = "block"; };

  // what the page carries, packed as by report/packing.py
  const bytesOf = async (id) => {
    const packed = Uint8Array.from(atob(element(id).textContent.trim()), (c) => c.charCodeAt(0));
    const plain = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(plain).arrayBuffer());
  };
  const arrayOf = (bytes, at, count, kind, origin, step, gaps, order) => {
    const view = new DataView(bytes.buffer, bytes.byteOffset), values = new Float64Array(count);
    if (kind === "f8") return values.map((_, i) => view.getFloat64(at + 8 * i, true));
    for (let i = 0, number = 0, last = 0; i < count; i++) {
      let folded = 0;
      for (let plane = 3; plane >= 0; plane--) folded = 256 * folded + bytes[at + plane * count + i];
      last = (order === 2 ? last : 0) + (folded % 2 ? -(folded + 1) / 2 : folded / 2);
      number += last;
      values[i] = origin + step * number;
      if (kind === "powers") values[i] = Math.exp(values[i]);
      if (gaps && !bytes[at + 4 * count + i]) values[i] = NaN;
    }
    return values;
  };
  const unpacked = async (id) => {
    const bytes = await bytesOf(id), end = 4 + new DataView(bytes.buffer).getUint32(0, true);
    const arrays = bytes.subarray(end);
    return JSON.parse(new TextDecoder().decode(bytes.subarray(4, end)),
      // a column of somebody's shot log may bear this name, too
      (_, value) => (Array.isArray(value?.packed) ? arrayOf(arrays, ...value.packed) : value));
  };

  for (const term of document.querySelectorAll("abbr[title]")) {
    // a finger shows no title
    term.addEventListener("click", () => {
      const said = [...document.querySelectorAll("#glossary dd")].find((entry) => entry.textContent === term.title);
      if (said) said.scrollIntoView({ block: "center" });
    });
  }

  for (const table of document.querySelectorAll("table.shots")) {
    const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
    const number = (text) => (text === "" || text === "\u2013" ? NaN : Number(text.replace("\u2212", "-").replaceAll("\u202f", "")));
    const cell = (row, k) => row.cells[k].textContent.trim();
    heads.forEach((head, k) => head.firstElementChild.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const compare = head.classList.contains("n")
        ? (a, b) => { // what is no number comes last, whichever way
            const [x, y] = [number(cell(a, k)), number(cell(b, k))];
            if (isNaN(x) || isNaN(y)) return isNaN(x) - isNaN(y);
            return down ? y - x : x - y;
          }
        : (a, b) => (down ? -1 : 1) * cell(a, k).localeCompare(cell(b, k), "en", { numeric: true });
      body.append(...[...body.rows].sort(compare));
    }));
  }

  if (!element("packed")) return;
  if (!window.DecompressionStream) return show("old");
  if (element("plotly")) {
    const script = document.createElement("script");
    script.textContent = new TextDecoder().decode(await bytesOf("plotly"));
    document.head.append(script);
  }
  if (!window.Plotly) return show("missing");
  const page = await unpacked("packed");
  document.documentElement.dataset.moved = "";
  const shot = String(page.report.shot).replace(/[^\w.-]+/g, "_");
  const figures = page.figures.map((figure, i) => ({ ...figure, place: element("plot-" + i), busy: false }));
  const save = element("save");
  if (save) save.addEventListener("click", () => {
    const link = document.createElement("a"), content = JSON.stringify(page.report, null, 2) + "\n";
    link.href = URL.createObjectURL(new Blob([content], { type: "application/json" }));
    link.download = shot + "-" + (page.report.target || "report") + ".json";
    link.click();
  });
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const ranges = new Map(); // of the axes that figures share, by what they are of
  const OPACITY = 0.42; // of what was recorded behind what is filtered
  let shown = figures.some((f) => f.switched && f.data.some((t) => t.meta === "filtered" && t.visible === undefined))
    ? "both" : "recorded";

  // two hues of the figures are too dark for a dark page
  const BRIGHT = { "0,114,178": "70,165,235", "185,35,85": "242,95,145" };
  const bright = (value) => {
    if (typeof value === "string") return value.replace(/\d+,\d+,\d+/, (hue) => BRIGHT[hue] ?? hue);
    if (Array.isArray(value)) return value.map(bright);
    if (!value || typeof value !== "object" || ArrayBuffer.isView(value)) return value;
    return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, bright(inner)]));
  };

  let onPaper = false;
  const isDark = () => dark.matches && !onPaper;
  const template = () => {
    const small = onPaper ? 9.5 : 12;
    const [ink, rule, edge, card] = isDark() ? ["#c3cedb", "#2b3642", "#4a5867", "#222b35"] : ["#3b4754", "#e6eaef", "#b4bec9", "#ffffff"];
    const axis = {
      gridcolor: rule, zerolinecolor: edge, zerolinewidth: 1, linecolor: edge, showline: true, mirror: true,
      ticks: "outside", ticklen: 4, tickcolor: edge, tickfont: { size: small }, title: { font: { size: small }, standoff: 8 },
    };
    return { layout: {
      font: { color: ink, size: small, family: getComputedStyle(document.body).fontFamily },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      xaxis: { ...axis, mirror: "all", ticks: "", spikecolor: edge, spikethickness: 1, spikedash: "solid", spikemode: "across", spikesnap: "cursor" },
      yaxis: { ...axis, automargin: true },
      hoverlabel: { bgcolor: card, bordercolor: edge, font: { color: ink, size: 12 }, namelength: -1 },
      ...Object.fromEntries(["", 2, 3, 4, 5, 6].map((k) => ["legend" + k, { bgcolor: "rgba(0,0,0,0)", font: { size: window.innerWidth < 500 ? 10 : small } }])),
      modebar: { bgcolor: "rgba(0,0,0,0)", color: edge, activecolor: ink },
    } };
  };

  const margins = () => (window.innerWidth < 500 ? { l: 58, r: 6, t: 34, b: 46 } : { l: 76, r: 16, t: 34, b: 46 });

  const draw = (figure) => {
    figure.place.querySelector("svg.still")?.remove();
    figure.place.style.height = figure.height + "px";
    const layout = { ...(isDark() ? bright(figure.layout) : figure.layout), height: figure.height, margin: margins(), template: template() };
    if (figure.link && ranges.has(figure.link)) layout[figure.axis] = { ...layout[figure.axis], range: ranges.get(figure.link) };
    for (const [i, visible] of figure.switched ? visibility(figure) : []) {
      figure.data[i].visible = visible;
      if (figure.data[i].opacity) figure.data[i].opacity = shown === "recorded" ? 1 : OPACITY;
    }
    // noted now, because plotly keeps its state in the data that it is given
    const hidden = new Set([...figure.data.keys()].filter((i) => figure.data[i].visible === "legendonly"));
    Plotly.newPlot(figure.place, isDark() ? bright(figure.data) : figure.data, layout, {
      responsive: true, scrollZoom: true, displaylogo: false, doubleClick: "reset",
      showSendToCloud: false, plotlyServerURL: "", // a shot's data never leaves the computer
      modeBarButtons: [["toImage"], ["zoom2d", "pan2d"], ["autoScale2d"]],
      toImageButtonOptions: { format: "png", filename: shot + "-" + figure.key.replace(/[^\w.-]+/g, "_"), scale: 2 },
    });
    // a minus sign as on the axes
    const readOut = figure.place.querySelector(".hoverlayer");
    new MutationObserver(() => {
      const texts = document.createTreeWalker(readOut, NodeFilter.SHOW_TEXT);
      while (texts.nextNode()) {
        const said = texts.currentNode.data, written = said.replace(/(^|[ (e])-(?=[\d.])/g, "$1\u2212");
        if (written !== said) texts.currentNode.data = written;
      }
    }).observe(readOut, { childList: true, subtree: true, characterData: true });
    figure.place.on("plotly_restyle", ([change, indices]) => {
      if (change.visible === undefined || figure.busy) return;
      [change.visible].flat().forEach((visible, k) => {
        const i = indices[k];
        if (visible === true && hidden.has(i)) bringIntoView(figure.place, i);
      });
    });
    if (!figure.link) return;
    figure.place.on("plotly_relayout", (change) => {
      if (!figure.busy && Object.keys(change).some((key) => key.startsWith(figure.axis + "."))) follow(figure);
    });
    figure.place.on("plotly_hover", (event) => { if (event.xvals) point(figure, event.xvals[0]); });
    figure.place.on("plotly_unhover", () => point(figure, null));
  };

  // all figures over one time: where one is zoomed to, and what instant it is read at, the others are as well
  const linked = (figure) => figures.filter((other) => other !== figure && other.link === figure.link && other.place._fullLayout);
  const change = async (figure, update) => {
    figure.busy = true;
    try { await Plotly.relayout(figure.place, update); } finally { figure.busy = false; }
  };
  const follow = (figure) => {
    const range = figure.place._fullLayout[figure.axis].range.slice();
    ranges.set(figure.link, range);
    for (const other of linked(figure)) change(other, { [other.axis + ".range"]: range.slice() });
  };
  const onScreen = (place) => {
    const box = place.getBoundingClientRect();
    return box.bottom > 0 && box.top < window.innerHeight;
  };
  const point = (figure, x) => {
    for (const other of linked(figure)) {
      const layout = other.place._fullLayout, axis = layout[other.axis];
      let line = other.place.querySelector(".instant");
      if (!line) {
        line = document.createElement("div");
        line.className = "instant";
        other.place.append(line);
      }
      const inside = x !== null && x >= axis.range[0] && x <= axis.range[1] && onScreen(other.place);
      line.style.display = inside ? "block" : "none";
      if (inside) {
        line.style.left = axis._offset + axis.d2p(x) + "px";
        line.style.top = layout._size.t + "px";
        line.style.height = layout._size.h + "px";
        const first = Object.keys(layout._plots).find((id) => layout._plots[id].xaxis === axis);
        Plotly.Fx.hover(other.place, { xval: x }, first, true);
      } else {
        Plotly.Fx.unhover(other.place);
      }
    }
  };

  // what was measured: as recorded, filtered, or both; a trace that has no counterpart stays
  const visibility = (figure) => {
    const paired = new Set(figure.data.filter((trace) => trace.meta === "measured").map((trace) => trace.yaxis));
    return [...figure.data.entries()]
      .filter(([, trace]) => paired.has(trace.yaxis) && (trace.meta === "measured" || trace.meta === "filtered"))
      .map(([i, trace]) => [i, shown === "both" || (shown === "recorded") === (trace.meta === "measured") ? true : "legendonly"]);
  };
  const buttons = document.querySelectorAll("button[data-show]");
  const press = () => { for (const button of buttons) button.setAttribute("aria-pressed", button.dataset.show === shown); };
  for (const button of buttons) button.addEventListener("click", async () => {
    shown = button.dataset.show;
    press();
    for (const figure of figures.filter((one) => one.switched && one.place._fullLayout)) {
      const changes = visibility(figure);
      figure.busy = true;
      await Plotly.restyle(figure.place, { visible: changes.map(([, visible]) => visible) }, changes.map(([i]) => i));
      const faint = changes.map(([i]) => i).filter((i) => figure.data[i].opacity);
      await Plotly.restyle(figure.place, { opacity: shown === "recorded" ? 1 : OPACITY }, faint);
      figure.busy = false;
    }
  });
  press();

  // a trace that was hidden at first may lie outside of what the others need; its outermost twentieths may stay there
  const bringIntoView = (place, i) => {
    const trace = place._fullData[i], name = (axis) => axis[0] + "axis" + axis.slice(1);
    const xs = place._fullLayout[name(trace.xaxis)], ys = place._fullLayout[name(trace.yaxis)];
    if (xs.type !== "linear" || ys.type !== "linear") return;
    const seen = Array.from(trace.y).filter((y, k) => Number.isFinite(y) && trace.x[k] >= xs.range[0] && trace.x[k] <= xs.range[1]);
    if (!seen.length) return;
    seen.sort((a, b) => a - b);
    const low = seen[Math.floor(0.05 * (seen.length - 1))], high = seen[Math.ceil(0.95 * (seen.length - 1))];
    const pad = 0.04 * (Math.max(high, ys.range[1]) - Math.min(low, ys.range[0]));
    const range = [low < ys.range[0] ? low - pad : ys.range[0], high > ys.range[1] ? high + pad : ys.range[1]];
    Plotly.relayout(place, { [name(trace.yaxis) + ".range"]: range });
  };

  // what a pointer does, by keys: by how many widths both ends of the time that is shown move
  const KEYS = { ArrowLeft: [-0.1, -0.1], ArrowRight: [0.1, 0.1], "+": [0.2, -0.2], "-": [-1 / 3, 1 / 3], 0: "reset" };
  const listen = (figure) => {
    const name = figure.axis + ".range", first = figure.layout[figure.axis].range?.slice();
    figure.place.addEventListener("keydown", (event) => {
      const ends = KEYS[event.key], range = figure.place._fullLayout?.[figure.axis].range;
      if (!ends || !range || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      const moved = ends === "reset" ? first : range.map((end, k) => end + ends[k] * (range[1] - range[0]));
      Plotly.relayout(figure.place, moved ? { [name]: moved.slice() } : { [figure.axis + ".autorange"]: true });
    });
  };

  // a wheel over a figure belongs to the page unless Ctrl asks for the zoom, or nobody gets past a figure
  for (const figure of figures) {
    listen(figure);
    figure.place.addEventListener("wheel", (event) => { if (!event.ctrlKey) event.stopPropagation(); }, { capture: true });
    const folded = figure.place.closest("details");
    // what is folded has no width yet
    if (folded) folded.addEventListener("toggle", () => { if (folded.open && !figure.place._fullLayout) draw(figure); });
    if (folded && !folded.open) continue;
    draw(figure);
    await new Promise((resolve) => setTimeout(resolve)); // so that the page can be read and moved meanwhile
  }
  document.documentElement.dataset.drawn = "all";

  const drawn = () => figures.filter((figure) => figure.place._fullLayout);
  dark.addEventListener("change", () => { for (const figure of drawn()) draw(figure); });

  // an A4 page between its margins is 690 CSS pixels wide; a name whose curve is not drawn says nothing there
  const hiddenOnes = (figure) => [...figure.place.data.keys()]
    .filter((i) => figure.place.data[i].visible === "legendonly" && figure.data[i].showlegend !== false);
  const places = (figure) => Object.fromEntries(Object.keys(figure.sheet.layout).map((key) => {
    const [part, name] = key.split(".");
    return [key, figure.layout[part][name]];
  }));
  const lay = (figure, height, update, named) => {
    const unnamed = hiddenOnes(figure);
    figure.busy = true;
    figure.place.style.height = height + "px";
    Plotly.update(figure.place, unnamed.length ? { showlegend: named } : {}, { height, template: template(), ...update }, unnamed.length ? unnamed : undefined);
    figure.busy = false;
  };
  window.addEventListener("beforeprint", () => {
    onPaper = true;
    for (const figure of drawn()) {
      if (dark.matches) draw(figure);
      lay(figure, figure.sheet.height, { ...figure.sheet.layout, width: 690, margin: { l: 60, r: 8, t: 26, b: 40 } }, false);
    }
  });
  window.addEventListener("afterprint", () => {
    onPaper = false;
    for (const figure of drawn()) {
      if (dark.matches) draw(figure);
      lay(figure, figure.height, { ...places(figure), width: null, autosize: true, margin: margins() }, true);
    }
  });
})();
