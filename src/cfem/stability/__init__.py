"""`cfem stability`: named cases of stiff and extreme situations, each with what is right for it stated in advance."""
