"""A comparison as one page that opens offline: pictures, tables and graphs, with nothing to fetch."""

from rendergraph.compare.report.page import comparison_page, notebook_html, quality_svg, sweep_page
