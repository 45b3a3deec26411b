"""A comparison as one page that opens offline: pictures, tables and graphs, with nothing to fetch."""

from rendergraph.compare.report.page import comparison_page as comparison_page
from rendergraph.compare.report.page import notebook_html as notebook_html
from rendergraph.compare.report.page import quality_svg as quality_svg
from rendergraph.compare.report.page import sweep_page as sweep_page
