"""How does gain depend on the conditions?"""
