"""The learned series of energy and skin, their domain, and (W, delta_free) from them."""
