"""A running relay on a terminal, from the state that it tells over HTTP: its client, its drawings, its screens."""
