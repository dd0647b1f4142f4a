"""The paper's table: grid and I_p(u, v)."""
