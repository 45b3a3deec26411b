// Nothing but what the fixed function does.
void main() {}
