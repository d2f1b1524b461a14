// Each cell knows its column's head, so that rows of wide tables can be stacked on a phone.
document.addEventListener("DOMContentLoaded", () => {
  for (const table of document.querySelectorAll(".bd-article table.table:not(.autosummary)")) {
    const heads = [...table.querySelectorAll("thead th")].map((head) => head.textContent.trim());
    const fits = table.offsetWidth <= table.parentElement.clientWidth;
    if (heads.length < 2 || (heads.length === 2 && fits)) continue;
    table.classList.add("stacks");
    for (const row of table.tBodies[0].rows) {
      [...row.cells].forEach((cell, i) => {
        if (!cell.textContent.trim()) cell.classList.add("blank");
        else if (i && heads[i]) cell.setAttribute("data-head", heads[i]);
      });
    }
  }
});
