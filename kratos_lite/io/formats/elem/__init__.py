"""The five-file sets NAME.node, .elem, .cond, .prop and .init (Kratos data of 2008): `reader`, `writer`."""
