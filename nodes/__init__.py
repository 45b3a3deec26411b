"""The standard nodes: one module a technique, folders by family."""
