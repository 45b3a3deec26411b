// Writes no colour; the pass only clears the stencil.
void main() {}
