"""The nodes of this plugin; a type's name is its module's."""
