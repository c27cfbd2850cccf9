// Charts by the program gnuplot.
#pragma once

typedef enum gnuplot_result { GNUPLOT_DONE, GNUPLOT_FAILED, GNUPLOT_MISSING } gnuplot_result;

// Runs a script, without its terminal, and writes PATH.svg and PATH.png beside and renamed. `width` and `height` are
// points of the page in the SVG; the PNG has twice as many pixels, and its fonts are in points of 96 per inch. The
// script is told not to look for markup. A failure is logged, but for a missing gnuplot.
gnuplot_result gnuplot_draw(const char *script, const char *path, int width, int height);
